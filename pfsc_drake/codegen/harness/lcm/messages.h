/* The robot's messages as LCM sends them over UDP: a short packet has a head of eight bytes, the
   channel's name with its zero, and the message, whose fields are big-endian. */
#ifndef MESSAGES_H
#define MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#include "drive_setup.h"

/* Status of a robot at one of its ticks. */
typedef struct {
    int64_t utime; /* clock of the robot, us */
    double q[DRIVE_JOINTS], v[DRIVE_JOINTS], torque[DRIVE_JOINTS];
    int robot_mode, control_mode;
} drive_status;

/* Return the message in a packet, NULL if it is on another channel or not a short packet. */
const unsigned char *packet_message(
    const unsigned char *packet, size_t size, const char *channel, size_t *length);

/* Return whether a message was a status of this robot, and read it. */
int decode_status(const unsigned char *message, size_t length, drive_status *status);

/* Return whether a message was a force sensor's, and read force and torque [N, Nm]. */
int decode_wrench(const unsigned char *message, size_t length, double wrench[6]);

/* Write a command as a packet of COMMAND_PACKET_SIZE bytes. */
void encode_command(
    uint32_t number, int64_t utime, const double values[DRIVE_JOINTS], unsigned char *packet);

#endif
