#define _POSIX_C_SOURCE 200809L

#include "recorder.h"

#include <pthread.h>
#include <semaphore.h>
#include <string.h>

#define ROOM 8192 /* waiting records */
#define LEAST_ROOM 3000 /* for those of a stop */
#define TOLD 0.2 /* s */

static const char magic[8] = "PFSCDRV1";

static drive_record records[ROOM], nowhere;
static sem_t written, free_places; /* counters; no thread ever waits for free places */
static size_t next;
static int has_place;
static volatile int is_broken;
static FILE *output;
static pthread_t writer;

int write_head(FILE *file)
{
    const uint32_t sizes[2] = {(uint32_t)sizeof(drive_record), DRIVE_JOINTS};
    return fwrite(magic, sizeof magic, 1, file) == 1 && fwrite(sizes, sizeof sizes, 1, file) == 1;
}

int read_head(FILE *file)
{
    char found[sizeof magic];
    uint32_t sizes[2];
    return fread(found, sizeof found, 1, file) == 1 && fread(sizes, sizeof sizes, 1, file) == 1
           && memcmp(found, magic, sizeof magic) == 0 && sizes[0] == sizeof(drive_record)
           && sizes[1] == DRIVE_JOINTS;
}

/* Write records until an empty one; print the progress from time to time. */
static void *write_records(void *unused)
{
    size_t at = 0;
    double told = 0.0;
    for (;;) {
        const drive_record *record = &records[at];
        double time;
        while (sem_wait(&written) != 0) {
        }
        if (record->size == 0) {
            return unused;
        }
        if (!is_broken && fwrite(record, sizeof *record, 1, output) != 1) {
            is_broken = 1;
        }
        time = (double)record->tick * CONTROLLER_SAMPLING_TIME;
        if (time - told > TOLD) {
            told = time;
            printf("t %.3f\n", time);
            fflush(stdout);
        }
        at = (at + 1) % ROOM;
        sem_post(&free_places);
    }
}

int recorder_open(const char *name)
{
    pthread_attr_t small;
    int status;
    output = fopen(name, "wb");
    if (output == NULL || !write_head(output) || sem_init(&written, 0, 0) != 0
        || sem_init(&free_places, 0, ROOM) != 0) {
        return 0;
    }
    pthread_attr_init(&small);
    pthread_attr_setstacksize(&small, 256 * 1024);
    status = pthread_create(&writer, &small, write_records, NULL);
    pthread_attr_destroy(&small);
    return status == 0;
}

drive_record *recorder_next(void)
{
    drive_record *record;
    if (!has_place) {
        has_place = sem_trywait(&free_places) == 0;
    }
    if (!has_place) {
        is_broken = 1;
    }
    record = has_place ? &records[next] : &nowhere;
    memset(record, 0, sizeof *record);
    return record;
}

void recorder_push(void)
{
    if (has_place) {
        has_place = 0;
        next = (next + 1) % ROOM;
        sem_post(&written);
    }
}

int recorder_is_behind(void)
{
    int left = 0;
    sem_getvalue(&free_places, &left);
    return is_broken || left < LEAST_ROOM;
}

int recorder_close(void)
{
    if (!has_place) {
        while (sem_wait(&free_places) != 0) {
        }
    }
    memset(&records[next], 0, sizeof records[next]);
    sem_post(&written);
    pthread_join(writer, NULL);
    return fclose(output) == 0 && !is_broken;
}
