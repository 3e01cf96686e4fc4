#include "messages.h"

#include <string.h>

#define HEAD 8     /* bytes of a packet before the channel */
#define UTIME 8    /* offset of the time, behind the fingerprint */
#define JOINTS 16  /* offset of the number of joints in a status */
#define WRENCH_AT 16
#define LARGEST_MODE 6

static const unsigned char magic[4] = {'L', 'C', '0', '2'};

static uint64_t get(const unsigned char *from, int bytes)
{
    uint64_t value = 0;
    int i;
    for (i = 0; i < bytes; ++i) {
        value = value << 8 | from[i];
    }
    return value;
}

static void put(unsigned char *to, uint64_t value, int bytes)
{
    int i;
    for (i = bytes - 1; i >= 0; --i) {
        to[i] = (unsigned char)(value & 0xff);
        value >>= 8;
    }
}

static void get_doubles(const unsigned char *from, int count, double sign, double *values)
{
    int i;
    for (i = 0; i < count; ++i) {
        const uint64_t bits = get(from + 8 * i, 8);
        memcpy(&values[i], &bits, sizeof bits);
        values[i] = sign < 0.0 ? -values[i] : values[i];
    }
}

const unsigned char *packet_message(
    const unsigned char *packet, size_t size, const char *channel, size_t *length)
{
    const size_t name = strlen(channel) + 1;
    if (size < HEAD + name || memcmp(packet, magic, sizeof magic) != 0
        || memcmp(packet + HEAD, channel, name) != 0) {
        return NULL;
    }
    *length = size - HEAD - name;
    return packet + HEAD + name;
}

int decode_status(const unsigned char *message, size_t length, drive_status *status)
{
    if (length != STATUS_SIZE || memcmp(message, status_fingerprint, UTIME) != 0
        || get(message + JOINTS, 4) != DRIVE_JOINTS) {
        return 0;
    }
    status->utime = (int64_t)get(message + UTIME, 8);
    get_doubles(message + STATUS_Q, DRIVE_JOINTS, 1.0, status->q);
    get_doubles(message + STATUS_V, DRIVE_JOINTS, 1.0, status->v);
    get_doubles(message + STATUS_TORQUE, DRIVE_JOINTS, STATUS_TORQUE_SIGN, status->torque);
#ifdef STATUS_ROBOT_MODE
    status->robot_mode = message[STATUS_ROBOT_MODE];
    status->control_mode = message[STATUS_CONTROL_MODE];
#else
    status->robot_mode = DRIVE_MOVES;
    status->control_mode = DRIVE_MODE;
#endif
    return status->robot_mode <= LARGEST_MODE;
}

int decode_wrench(const unsigned char *message, size_t length, double wrench[6])
{
    if (length != WRENCH_SIZE || memcmp(message, wrench_fingerprint, UTIME) != 0) {
        return 0;
    }
    get_doubles(message + WRENCH_AT, 6, 1.0, wrench);
    return 1;
}

void encode_command(
    uint32_t number, int64_t utime, const double values[DRIVE_JOINTS], unsigned char *packet)
{
    unsigned char *message = packet + HEAD + sizeof COMMAND_CHANNEL;
    int i;
    memcpy(packet, magic, sizeof magic);
    put(packet + sizeof magic, number, 4);
    memcpy(packet + HEAD, COMMAND_CHANNEL, sizeof COMMAND_CHANNEL);
    memcpy(message, command_message, COMMAND_SIZE);
    put(message + UTIME, (uint64_t)utime, 8);
    for (i = 0; i < DRIVE_JOINTS; ++i) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put(message + COMMAND_VALUES + 8 * i, bits, 8);
    }
}
