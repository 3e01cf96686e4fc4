/* Record of a drive: statuses and commands. A separate thread writes it, so that the loop never
   waits for a disk. */
#ifndef RECORDER_H
#define RECORDER_H

#include <stdio.h>

#include "drive.h"

/* One answered status: everything needed to repeat it, and the answer.
   Members without gaps between them, as experiments/hardware/native_record.py reads them. */
typedef struct {
    int64_t tick;    /* number of the tick */
    double received; /* since the loop began, s */
    double age;      /* from then to the answer, s */
    double override; /* requested speed as a share of the planned one */
    double wrench[6];
    double sent[DRIVE_JOINTS];
    int32_t missed, clipped, robot_mode, fault;
    int32_t event; /* event before the answer */
    int32_t size;  /* of the message */
    unsigned char message[STATUS_ROOM];
} drive_record;

/* Begin a file; return whether this succeeded. */
int recorder_open(const char *name);

/* Return the memory for the next record; recorder_push completes it. */
drive_record *recorder_next(void);
void recorder_push(void);

/* Return whether the file cannot be written, or not fast enough. */
int recorder_is_behind(void);

/* Return whether everything has been written. */
int recorder_close(void);

/* Write the head of a file; return whether this succeeded. */
int write_head(FILE *file);

/* Read the head; return whether it belongs to a record of this robot. */
int read_head(FILE *file);

#endif
