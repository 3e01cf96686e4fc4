#include "drive.h"

#include <math.h>
#include <string.h>

#include "robot.h"

#define N DRIVE_JOINTS
#if CONTROLLER_DRIVES != DRIVE_JOINTS
#error "the controller is of another robot"
#endif

static void copy_state(const drive_status *status, double state[4 * N])
{
    memcpy(state, status->q, sizeof status->q);
    memcpy(state + N, status->v, sizeof status->v);
    memcpy(state + 2 * N, status->q, sizeof status->q);
    memcpy(state + 3 * N, status->v, sizeof status->v);
}

static int are_finite(const double *values, int count)
{
    int i;
    for (i = 0; i < count; ++i) {
        if (!isfinite(values[i])) {
            return 0;
        }
    }
    return 1;
}

static double within(double value, double bound)
{
    return value > bound ? bound : value < -bound ? -bound : value;
}

/* Speed of the fastest joint; NaN if one of them is NaN. */
static double fastest(const double v[N])
{
    double most = 0.0;
    int i;
    for (i = 0; i < N; ++i) {
        if (isnan(v[i])) {
            return v[i];
        }
        most = fabs(v[i]) > most ? fabs(v[i]) : most;
    }
    return most;
}

int drive_accepts(const drive_status *status)
{
    int i;
    if (status->robot_mode != DRIVE_MOVES
        || (status->control_mode != 0 && status->control_mode != DRIVE_MODE)
        || !are_finite(status->q, N) || !are_finite(status->v, N) || fastest(status->v) > DRIVE_AT_REST) {
        return 0;
    }
    for (i = 0; i < N; ++i) {
        if (fabs(status->q[i] - drive_start[i]) > DRIVE_AT_START) {
            return 0;
        }
    }
    return 1;
}

double drive_time(const drive_state *drive)
{
    return (double)drive->tick * CONTROLLER_SAMPLING_TIME;
}

static void step(drive_state *drive, controller_outputs *outputs, int *fault)
{
    controller_inputs inputs;
    drive_fill(&inputs, &drive->told);
    *fault = controller_step(&drive->controller, &inputs, outputs);
    ++drive->tick;
#if DRIVE_HAS_MOTION
    drive->motion_time += CONTROLLER_SAMPLING_TIME * drive->controller.x[DRIVE_PACE];
#else
    drive->motion_time += CONTROLLER_SAMPLING_TIME * 1.0;
#endif
}

void drive_begin(
    drive_state *drive, const drive_status *status, const double wrench[6], double override)
{
    controller_inputs inputs;
    memset(drive, 0, sizeof *drive);
    drive->told.override = override;
    drive->stop_speed = INFINITY;
    drive->first = status->utime;
    memcpy(drive->q, drive_start, sizeof drive->q);
    copy_state(status, drive->told.joint_state);
    memcpy(drive->told.joint_torque, status->torque, sizeof status->torque);
    memcpy(drive->told.wrench, wrench, sizeof drive->told.wrench);
    drive_fill(&inputs, &drive->told);
    controller_initialize(&drive->controller, &inputs);
}

static void begin_stop(drive_state *drive)
{
    const double *v = drive->last_state + N;
    double most = 0.0;
    int i, known = 0;
    for (i = 0; i < N; ++i) {
        if (!isnan(v[i])) {
            most = fabs(v[i]) > most ? fabs(v[i]) : most;
            known = 1;
        }
    }
    drive->is_stopping = 1;
    drive->stop_time = drive_time(drive);
    drive->stop_speed = known ? DRIVE_STOP_FACTOR * most + DRIVE_STOP_SPEED : NAN;
}

void drive_stop(drive_state *drive)
{
    if (!drive->is_stopping) {
        begin_stop(drive);
        drive->told.stop_request = 1.0;
    }
}

/* Number of ticks between the last answered one and a status. */
static double missing(const drive_state *drive, const drive_status *status)
{
    const int64_t passed = (int64_t)((uint64_t)status->utime - (uint64_t)drive->first);
    return rint((double)passed / (1e6 * CONTROLLER_SAMPLING_TIME)) - (double)drive->tick;
}

int drive_is_old(const drive_state *drive, const drive_status *status)
{
    return missing(drive, status) < 0.0;
}

/* Reject positions that have jumped farther than joints can move. */
static void believe(drive_state *drive, double state[4 * N], double ticks)
{
    int i, any = 0;
    for (i = 0; i < N && drive->tick > 0; ++i) {
        const double jump = fabs(state[i] - drive->last_state[i]);
        const double most = drive_fastest[i] * CONTROLLER_SAMPLING_TIME * ticks + DRIVE_LEAST_JUMP;
        if (jump > most && !drive->lost[i]) {
            drive->lost[i] = any = 1;
        }
    }
    if (any) {
        drive_stop(drive);
    }
    for (i = 0; i < N; ++i) {
        if (drive->lost[i]) {
            state[i] = state[2 * N + i] = NAN;
        }
    }
}

/* Advance the controller through missed ticks with interpolated states. */
static void bridge(
    drive_state *drive, const double state[4 * N], const double torque[N], int missed)
{
    const double span = (double)(missed + 1) * CONTROLLER_SAMPLING_TIME;
    const double *q_0 = drive->last_state, *v_0 = q_0 + N, *q_1 = state, *v_1 = q_1 + N;
    double *told = drive->told.joint_state;
    controller_outputs outputs;
    int k, i, fault;
    for (k = 1; k <= missed; ++k) {
        const double share = (double)k / (double)(missed + 1), rest = 1.0 - share;
        const double way = share * share * (3.0 - 2.0 * share);
        const double way_0 = span * share * (rest * rest), way_1 = span * (share * share) * rest;
        const double rate = 6.0 * share * rest / span;
        const double rate_0 = rest * (1.0 - 3.0 * share), rate_1 = share * (1.0 - 3.0 * rest);
        for (i = 0; i < N; ++i) {
            told[i] = q_0[i] + way * (q_1[i] - q_0[i]) + way_0 * v_0[i] - way_1 * v_1[i];
            told[N + i] = rate * (q_1[i] - q_0[i]) + rate_0 * v_0[i] + rate_1 * v_1[i];
            drive->told.joint_torque[i] = rest * drive->last_torque[i] + share * torque[i];
        }
        memcpy(told + 2 * N, told, 2 * N * sizeof *told);
        step(drive, &outputs, &fault);
    }
}

/* Command to be sent, and number of joints that were clipped. */
static void limit(const drive_state *drive, const double wanted[N], drive_command *command)
{
    int i;
    memcpy(command->sent, wanted, sizeof command->sent);
    command->clipped = 0;
    if (!DRIVE_IS_TORQUE) {
        return;
    }
    for (i = 0; i < N; ++i) {
        double value = within(wanted[i], drive_limit[i]);
        if (drive->has_sent) {
            const double most = drive_rate[i] * CONTROLLER_SAMPLING_TIME;
            value = drive->sent[i] + within(value - drive->sent[i], most);
        }
        command->sent[i] = value;
        command->clipped += fabs(value - wanted[i]) > 1e-9;
    }
}

int drive_answer(
    drive_state *drive, const drive_status *status, const double wrench[6],
    drive_command *command)
{
    const double missed = missing(drive, status);
    double state[4 * N], wanted[N], time, speed;
    controller_outputs outputs;
    int i, fault;
    memset(command, 0, sizeof *command);
    if (missed * CONTROLLER_SAMPLING_TIME > DRIVE_LARGEST_GAP) {
        drive->end = DRIVE_CLOCK;
        return 0;
    }
    command->missed = (int32_t)missed;
    memcpy(drive->told.wrench, wrench, sizeof drive->told.wrench);
    copy_state(status, state);
    believe(drive, state, missed + 1.0);
    bridge(drive, state, status->torque, command->missed);
    if (command->missed > DRIVE_BRIDGED) {
        drive_stop(drive);
    }
    memcpy(drive->told.joint_state, state, sizeof state);
    memcpy(drive->told.joint_torque, status->torque, sizeof status->torque);
    for (i = 0; i < N; ++i) {
        drive->q[i] = isfinite(state[i]) ? state[i] : drive->q[i];
    }
    time = drive_time(drive);
    step(drive, &outputs, &fault);
    memcpy(wanted, &outputs, sizeof wanted);
    if (DRIVE_IS_TORQUE) {
        double weight[N];
        robot_weight(drive->q, weight);
        for (i = 0; i < N; ++i) {
            wanted[i] -= weight[i];
        }
    }
    limit(drive, wanted, command);
    command->fault = fault;
    if (!are_finite(command->sent, N)) {
        drive->end = DRIVE_NOT_FINITE;
        --drive->tick;
        return 0;
    }
    if (fault != 0 && !drive->is_stopping) {
        begin_stop(drive);
        drive->stop_time = time;
    }
    memcpy(drive->sent, command->sent, sizeof drive->sent);
    drive->has_sent = 1;
    memcpy(drive->last_state, state, sizeof state);
    memcpy(drive->last_torque, status->torque, sizeof status->torque);
    if (status->robot_mode != DRIVE_MOVES) {
        drive->end = DRIVE_LEFT_MODE;
    }
    speed = fastest(status->v);
    if (speed > drive->stop_speed) {
        drive->end = DRIVE_FASTER;
    }
    drive->resting = speed <= DRIVE_AT_REST ? drive->resting + 1 : 0;
    return 1;
}

drive_end drive_ends(const drive_state *drive)
{
    if (drive->end != DRIVE_GOES_ON || !drive->is_stopping) {
        return drive->end;
    }
    if (drive_time(drive) - drive->stop_time > DRIVE_LONGEST_STOP
        || (double)drive->resting * CONTROLLER_SAMPLING_TIME > DRIVE_RESTED_FOR) {
        return DRIVE_RESTED;
    }
    return DRIVE_GOES_ON;
}
