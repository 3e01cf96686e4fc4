/* Drive a robot by the controller: one tick for each status, over LCM's UDP multicast.

   usage: drive_lcm ADDRESS PORT TTL SECONDS RECORD [OVERRIDE]
          drive_lcm -r RECORD SECONDS OTHER

   Ends after SECONDS of the planned motion's time, or when the robot has come to rest after a
   fault, after SIGINT, or after the parent process has closed the standard input; immediately when
   the robot is silent or has left its mode, in which case its driver damps. On the standard input,
   lines "o SHARE" set the speed of the reference and "s" requests a stop. Everything goes into
   RECORD. With -r the statuses of a record are answered again, as fast as possible, and nothing is
   sent. Prints the progress, and as its last line the reason of the end. This is not a safety
   function.
*/
#define _DEFAULT_SOURCE

#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <netinet/in.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "recorder.h"

#define LARGEST_PACKET 65536
#define MOST_PACKETS 1000 /* handled before an answer */
#define RECENT 64         /* own commands, to recognize them */
#define STACK 262144      /* bytes, touched in advance */

static const char *const reasons[] = {
    "duration", "rested", "mode", "not_finite", "clock", "faster"};

static volatile sig_atomic_t is_interrupted;

/* Last messages. */
static struct {
    drive_status status;
    double wrench[6], received;
    unsigned char message[STATUS_ROOM];
    int is_new;
} heard;

static struct {
    int in, out;
    int is_led; /* whether the standard input is open */
    int is_asked_to_stop;
    double override; /* requested speed as a share of the planned one */
    struct sockaddr_in group;
    uint32_t count;
    unsigned char recent[RECENT][COMMAND_PACKET_SIZE]; /* sent commands */
    unsigned long foreign; /* commands of other senders */
} bus;

static void interrupt(int number)
{
    (void)number;
    is_interrupted = 1;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int open_bus(const char *address, const char *port, const char *ttl)
{
    const int yes = 1;
    const unsigned char hops = (unsigned char)atoi(ttl), loop = 1;
    struct sockaddr_in here;
    struct ip_mreq group;
    memset(&bus, 0, sizeof bus);
    bus.is_led = 1;
    bus.group.sin_family = AF_INET;
    bus.group.sin_port = htons((unsigned short)atoi(port));
    if (inet_pton(AF_INET, address, &bus.group.sin_addr) != 1) {
        return 0;
    }
    here = bus.group;
    here.sin_addr.s_addr = htonl(INADDR_ANY);
    group.imr_multiaddr = bus.group.sin_addr;
    group.imr_interface.s_addr = htonl(INADDR_ANY);
    bus.in = socket(AF_INET, SOCK_DGRAM, 0);
    bus.out = socket(AF_INET, SOCK_DGRAM, 0);
    return bus.in >= 0 && bus.out >= 0
           && setsockopt(bus.in, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0
#ifdef SO_REUSEPORT
           && setsockopt(bus.in, SOL_SOCKET, SO_REUSEPORT, &yes, sizeof yes) == 0
#endif
           && bind(bus.in, (struct sockaddr *)&here, sizeof here) == 0
           && setsockopt(bus.in, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0
           && setsockopt(bus.out, IPPROTO_IP, IP_MULTICAST_TTL, &hops, sizeof hops) == 0
           && setsockopt(bus.out, IPPROTO_IP, IP_MULTICAST_LOOP, &loop, sizeof loop) == 0;
}

/* Count a command on the bus that was not sent from here. */
static void compare_command(const unsigned char *message, size_t length)
{
    const uint32_t known = bus.count < RECENT ? bus.count : RECENT;
    uint32_t k;
    for (k = 1; k <= known; ++k) {
        size_t size;
        const unsigned char *sent = packet_message(
            bus.recent[(bus.count - k) % RECENT], COMMAND_PACKET_SIZE, COMMAND_CHANNEL, &size);
        if (sent != NULL && size == length && memcmp(sent, message, length) == 0) {
            return;
        }
    }
    ++bus.foreign;
}

/* Handle all waiting packets. */
static void drain(void)
{
    static unsigned char packet[LARGEST_PACKET];
    int k;
    for (k = 0; k < MOST_PACKETS; ++k) {
        const ssize_t size = recv(bus.in, packet, sizeof packet, MSG_DONTWAIT);
        const unsigned char *message;
        size_t length;
        if (size < 0) {
            return;
        }
        message = packet_message(packet, (size_t)size, STATUS_CHANNEL, &length);
        if (message != NULL && decode_status(message, length, &heard.status)) {
            memcpy(heard.message, message, length);
            heard.is_new = 1;
        }
        message = packet_message(packet, (size_t)size, WRENCH_CHANNEL, &length);
        if (message != NULL) {
            decode_wrench(message, length, heard.wrench);
        }
        message = packet_message(packet, (size_t)size, COMMAND_CHANNEL, &length);
        if (message != NULL) {
            compare_command(message, length);
        }
    }
}

/* Read the parent's requests line by line, and detect its end. */
static void listen_to_leader(void)
{
    char lines[4096], *line;
    const ssize_t size = read(STDIN_FILENO, lines, sizeof lines - 1);
    if (size <= 0) {
        bus.is_led = size < 0 && errno == EINTR;
        return;
    }
    lines[size] = 0;
    for (line = strtok(lines, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        if (line[0] == 'o') {
            bus.override = atof(line + 1);
        } else if (line[0] == 's') {
            bus.is_asked_to_stop = 1;
        }
    }
}

/* Wait for a status; return whether one has come in time. */
static int receive(double timeout)
{
    const double end = now() + timeout;
    struct pollfd sources[2] = {{bus.in, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    for (;;) {
        double left;
        heard.received = now();
        drain();
        if (heard.is_new) {
            heard.is_new = 0;
            return 1;
        }
        left = end - now();
        if (left <= 0.0) {
            return 0;
        }
        errno = 0;
        if (poll(sources, bus.is_led ? 2 : 1, (int)ceil(1e3 * left)) > 0 && bus.is_led
            && sources[1].revents != 0) {
            listen_to_leader();
        }
    }
}

static void send_command(const drive_status *status, const double *values)
{
    unsigned char *packet = bus.recent[bus.count % RECENT];
    encode_command(bus.count, status->utime, values, packet);
    ++bus.count;
    sendto(
        bus.out, packet, COMMAND_PACKET_SIZE, 0, (struct sockaddr *)&bus.group, sizeof bus.group);
}

static void note(
    drive_record *record, const drive_status *status, int64_t tick, int event,
    const drive_command *command)
{
    record->tick = tick;
    record->event = event;
    record->robot_mode = status->robot_mode;
    record->missed = command->missed;
    record->clipped = command->clipped;
    record->fault = command->fault;
    memcpy(record->sent, command->sent, sizeof record->sent);
    record->size = STATUS_SIZE;
}

/* Return the event since the last status. */
static int look_around(void)
{
    return (is_interrupted ? DRIVE_INTERRUPTED : 0) | (bus.is_led ? 0 : DRIVE_ALONE)
           | (recorder_is_behind() ? DRIVE_UNRECORDED : 0)
           | (bus.is_asked_to_stop ? DRIVE_ASKED : 0) | (bus.foreign != 0 ? DRIVE_FOREIGN : 0);
}

static int is_over(const drive_state *drive, double seconds)
{
    return drive_ends(drive) != DRIVE_GOES_ON
           || drive->motion_time >= seconds + 0.5 * CONTROLLER_SAMPLING_TIME;
}

/* Drive until there is a reason to end, and return it. */
static const char *run(double seconds)
{
    static drive_state drive;
    static drive_command command;
    const double begin = now();
    drain(); /* packets from before the start */
    heard.is_new = 0;
    bus.foreign = 0;
    if (!receive(DRIVE_SILENCE)) {
        return "silence";
    }
    drive_begin(&drive, &heard.status, heard.wrench, bus.override);
    if (!drive_accepts(&heard.status)) {
        drive_record *record = recorder_next();
        note(record, &heard.status, 0, 0, &command);
        memcpy(record->message, heard.message, STATUS_SIZE);
        recorder_push();
        return "refused";
    }
    for (;;) {
        const int event = look_around();
        if (event != 0) {
            drive_stop(&drive);
        }
        if (!drive_is_old(&drive, &heard.status)) {
            int is_answer;
            drive_record *record;
            double answered;
            drive.told.override = bus.override;
            is_answer = drive_answer(&drive, &heard.status, heard.wrench, &command);
            if (is_answer) {
                send_command(&heard.status, command.sent);
            }
            answered = now();
            record = recorder_next();
            note(record, &heard.status, drive.tick - is_answer, event, &command);
            record->received = heard.received - begin;
            record->age = answered - heard.received;
            record->override = bus.override;
            memcpy(record->wrench, heard.wrench, sizeof record->wrench);
            memcpy(record->message, heard.message, STATUS_SIZE);
            recorder_push();
        }
        if (drive_ends(&drive) == DRIVE_FASTER) {
            static const double nothing[DRIVE_JOINTS];
            send_command(&heard.status, nothing);
        }
        if (is_over(&drive, seconds)) {
            return reasons[drive_ends(&drive)];
        }
        if (!receive(DRIVE_SILENCE)) {
            return "silence";
        }
    }
}

/* Answer the statuses of a record again; return the reason to end, NULL on failure. */
static const char *repeat(const char *from, double seconds, const char *to)
{
    static drive_state drive;
    static drive_command command;
    static drive_record record;
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    const char *reason = NULL;
    size_t count = 0;
    if (in != NULL && out != NULL && read_head(in) && write_head(out)) {
        reason = "record";
        while (fread(&record, sizeof record, 1, in) == 1) {
            if (!decode_status(record.message, (size_t)record.size, &heard.status)) {
                continue;
            }
            if (count++ == 0) {
                drive_begin(&drive, &heard.status, record.wrench, record.override);
            }
            if (is_over(&drive, seconds)) {
                reason = reasons[drive_ends(&drive)];
                break;
            }
            if (record.event != 0) {
                drive_stop(&drive);
            }
            if (!drive_is_old(&drive, &heard.status)) {
                int is_answer;
                drive.told.override = record.override;
                is_answer = drive_answer(&drive, &heard.status, record.wrench, &command);
                note(&record, &heard.status, drive.tick - is_answer, record.event, &command);
                reason = fwrite(&record, sizeof record, 1, out) == 1 ? reason : NULL;
            }
        }
    }
    if (in != NULL) {
        fclose(in);
    }
    return out != NULL && fclose(out) == 0 ? reason : NULL;
}

/* Use real-time priority and locked memory, where that is allowed. */
static void go_first(void)
{
    const struct sched_param priority = {.sched_priority = DRIVE_PRIORITY};
    volatile char stack[STACK];
    size_t i;
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) {
        printf("no real-time priority here: %s\n", strerror(errno));
    }
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        printf("memory is not locked: %s\n", strerror(errno));
    }
    for (i = 0; i < sizeof stack; i += 1024) {
        stack[i] = 0;
    }
}

int main(int argc, char **argv)
{
    static const int of_terminals[] = {SIGINT, SIGHUP};
    size_t k;
    struct sigaction caught, before;
    const char *reason;
    if (argc == 5 && strcmp(argv[1], "-r") == 0) {
        reason = repeat(argv[2], atof(argv[3]), argv[4]);
        printf("end %s\n", reason == NULL ? "nothing" : reason);
        return reason == NULL ? 2 : 0;
    }
    if (argc < 6 || argc > 7) {
        fprintf(stderr, "usage: drive_lcm ADDRESS PORT TTL SECONDS RECORD [OVERRIDE]\n");
        return 2;
    }
    memset(&caught, 0, sizeof caught);
    caught.sa_handler = interrupt;
    sigaction(SIGTERM, &caught, NULL);
    for (k = 0; k < sizeof of_terminals / sizeof of_terminals[0]; k++) {
        if (sigaction(of_terminals[k], NULL, &before) == 0 && before.sa_handler != SIG_IGN) {
            sigaction(of_terminals[k], &caught, NULL); /* ignored signals stay ignored, as under nohup */
        }
    }
    caught.sa_handler = SIG_IGN;
    sigaction(SIGPIPE, &caught, NULL);
    if (!open_bus(argv[1], argv[2], argv[3])) {
        fprintf(stderr, "%s:%s: %s\n", argv[1], argv[2], strerror(errno));
        return 2;
    }
    if (!recorder_open(argv[5])) {
        fprintf(stderr, "%s: %s\n", argv[5], strerror(errno));
        return 2;
    }
    bus.override = argc == 7 ? atof(argv[6]) : 1.0;
    go_first();
    reason = run(atof(argv[4]));
    printf("%s", recorder_close() ? "" : "the record is not complete: it could not be written\n");
    if (bus.foreign != 0) {
        printf("%lu commands were not sent by this controller\n", bus.foreign);
    }
    printf("end %s\n", reason);
    return 0;
}
