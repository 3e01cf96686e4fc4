/* The record of a drive: what came, what was sent. A thread of its own writes it, so that the loop
   never waits for a disk. */
#ifndef RECORDER_H
#define RECORDER_H

#include <stdio.h>

#include "drive.h"

/* Of one status that was answered: everything needed to repeat it, and what it was answered with.
   Members without gaps between them, as experiments/hardware/native_record.py reads them. */
typedef struct {
    int64_t tick;    /* its number */
    double received; /* since the loop began, s */
    double age;      /* from then to the answer, s */
    double override; /* share of the planned pace that was asked for */
    double wrench[6];
    double sent[DRIVE_JOINTS];
    int32_t missed, clipped, robot_mode, fault;
    int32_t event; /* what happened before */
    int32_t size;  /* of the message */
    unsigned char message[STATUS_ROOM];
} drive_record;

/* Begin a file; return whether that could be done. */
int recorder_open(const char *name);

/* Return where the next record is to be written; it counts from recorder_push on. */
drive_record *recorder_next(void);
void recorder_push(void);

/* Return whether the file cannot be written, or not as fast as it would have to be. */
int recorder_is_behind(void);

/* Return whether everything has been written. */
int recorder_close(void);

/* Write the head of a file; return whether that could be done. */
int write_head(FILE *file);

/* Read it; return whether it is that of a record of this robot. */
int read_head(FILE *file);

#endif
