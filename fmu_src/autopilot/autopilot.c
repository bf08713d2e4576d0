/* An autopilot for vehicles whose thrusters push along every axis that is held. For each axis, a place or an angle becomes a rate, and a rate
 * becomes a demand by a PID controller with filters and feed-forward; the thrusters share the demands. It samples its sensors once per
 * step and knows no equation of motion, so that an FMU, a page and the engine include it unchanged. Axes are surge, sway,
 * heave, roll, pitch and yaw. `gains.h` declares `loop_gains`; a gain, limit or frequency of 0 is none. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "gains.h"

enum { AXES = 6, HEAVE_AXIS = 2, ROLL_AXIS = 3, YAW_AXIS = 5, MOST_THRUSTERS = 32 };

/* The modes of an axis: its aim is a share of the largest demand, a rate, or a place or an angle. */
#define STICK 0.0
#define RATE 1.0
#define PLACE 2.0
#define STOP 3.0 /* in the place of PLACE while the place is not known: a rate of 0, over ground */
#define PI 3.141592653589793

/* A thruster: its output for the demands (B+, or the factors of a frame), what it gives along the axes (B), and the rows
 * of its table. Forces are in newtons, or fractions for a frame. */
typedef struct {
    double of_axis[AXES], to_axis[AXES], row, rows;
} thruster;

/* Forces and the fractions of the full command that give them, both rising. */
typedef struct {
    double force, command;
} table_row;

/* How the thrusters make the demands. Axes of priority 0 come before those of 1, which share what is left. In memory, the thrusters, the
 * rows of all tables, and the commands by thrusters (commands x thrusters) follow. */
typedef struct {
    double thrusters, rows, commands;
    double scales;         /* 1: an axis of a group that asks for too much scales the group; 0: outputs are only clipped */
    double steps;          /* outputs are rounded down to 1/steps; 0 for none */
    double attitude;       /* 1: the errors of an attitude are those of its quaternion, and demands turn with the attitude */
    double stick_time;     /* with which a stick moves, s */
    double neutral, ahead, astern; /* the command without thrust, and what is added for a full one */
    double priority[AXES];
} sharing;

/* What the filters and integrators of an axis contain. */
typedef struct {
    double target, error, slope, integral, last, before, slow, rate, wanted, demand, carry, begun, aim, mode;
} loop_state;

/* What the sensors tell: the position and Euler angles; the velocity through the water and the turn rates along the body's axes; the
 * velocity over ground, north, east and down. SI units. */
typedef struct {
    double place[AXES], rate[AXES], ground[3];
} sensor_values;

static double within(double x, double most)
{
    return fmin(fmax(x, -most), most);
}

static double limited(double x, double most)
{
    return most > 0.0 ? within(x, most) : x;
}

/* Return the part of a change that passes a low-pass filter of first order in a step. */
static double passed(double frequency, double h)
{
    return frequency > 0.0 ? 1.0 / (1.0 + 0.5 / (PI * frequency * h)) : 1.0;
}

/* Return an angle within half a turn. */
static double wrapped(double angle)
{
    return angle - 2.0 * PI * floor(angle / (2.0 * PI) + 0.5);
}

/* Return the rate that removes an error: proportional at first, then with the deceleration `brake` at most. An angle counts only as
 * far as the brake lets the proportional law go. */
static double rate_for(double error, const loop_gains *k, bool turns)
{
    double size = fabs(error), rate = k->k_x * size;
    if (k->brake > 0.0) {
        const double linear = k->brake / (k->k_x * k->k_x);
        size = turns ? fmin(size, k->brake / k->k_x) : size;
        rate = size <= linear ? k->k_x * size : sqrt(2.0 * k->brake * (size - 0.5 * linear));
    }
    return copysign(k->v_max > 0.0 ? fmin(rate, k->v_max) : rate, error);
}

/* Return what a low-pass filter of second order (Butterworth) makes of a measurement. */
static double filtered(loop_state *s, double measured, double frequency, double h, bool begins)
{
    if (!(frequency > 0.0)) {
        return measured;
    }
    const double w = tan(PI * frequency * h), scale = 1.0 + sqrt(2.0) * w + w * w;
    if (begins) {
        s->last = s->before = measured * scale / (4.0 * w * w);
    }
    const double kept = 2.0 * (w * w - 1.0) * s->last + (1.0 - sqrt(2.0) * w + w * w) * s->before;
    const double now = measured - kept / scale, result = w * w / scale * (now + 2.0 * s->last + s->before);
    s->before = s->last;
    s->last = now;
    return result;
}

/* Return what an axis asks for, whose rate shall be `wanted` and is `rate`. With the gain k_a, the last controller is one of acceleration.
 * Where a hold begins, its filters contain what is measured. */
static double loop_step(const loop_gains *k, loop_state *s, double wanted, double rate, double h, bool begins)
{
    double measured = rate, aim = wanted;
    if (begins) {
        s->rate = rate;
        s->slow = s->slope = 0.0;
    }
    if (k->k_a > 0.0) {
        s->slow += passed(k->f_a, h) * (wanted - rate - s->slow);
        aim = k->k_a * s->slow;
        measured = (rate - s->rate) / h;
    }
    measured = filtered(s, measured, k->f_sensor, h, begins);
    if (begins) {
        s->target = aim;
        s->error = aim - measured;
        s->wanted = wanted;
    }
    const double target = s->target + passed(k->f_target, h) * (aim - s->target);
    const double change = passed(k->f_error, h) * (target - measured - s->error);
    s->target = target;
    s->error += change;
    s->slope += passed(k->f_target, h) * (change / h - s->slope);
    s->integral = limited(s->integral + k->k_i * s->error * h, k->i_max);
    const double speeding = (1.0 - s->begun) * limited((wanted - s->wanted) / h, k->brake);
    s->rate = rate;
    s->wanted = wanted;
    return k->k_p * s->error + s->integral + k->k_d * s->slope + k->k_ff * target + (k->d_1 + k->d_2 * fabs(wanted)) * wanted +
           k->inertia * speeding + k->bias;
}

/* Return y at x of rows of a table whose x and y rise; beyond the ends, y is that of the end. The numbers stand `stride` apart. */
static double on_line(const double x_of[], const double y_of[], int rows, double x)
{
    int n = 1;
    while (n < rows - 1 && x_of[2 * n] < x) {
        n++;
    }
    const double x0 = x_of[2 * n - 2], y0 = y_of[2 * n - 2], part = (x - x0) / (x_of[2 * n] - x0);
    return y0 + fmin(fmax(part, 0.0), 1.0) * (y_of[2 * n] - y0);
}

/* Turn a vector from the level frame, which has the vehicle's heading, into its body frame; back if the angles are to be undone. */
static void tilted(double v[3], double phi, double theta, bool back)
{
    const double a = sin(phi), b = cos(phi), c = sin(theta), d = cos(theta), x = v[0], y = v[1], z = v[2];
    if (back) {
        const double down = a * y + b * z;
        v[0] = d * x + c * down;
        v[1] = b * y - a * z;
        v[2] = d * down - c * x;
    } else {
        const double down = c * x + d * z;
        v[0] = d * x - c * z;
        v[1] = b * y + a * down;
        v[2] = b * down - a * y;
    }
}

static void quaternion(const double angle[3], double q[4])
{
    double c[3], s[3];
    for (int i = 0; i < 3; i++) {
        c[i] = cos(0.5 * angle[i]);
        s[i] = sin(0.5 * angle[i]);
    }
    q[0] = c[0] * c[1] * c[2] + s[0] * s[1] * s[2];
    q[1] = s[0] * c[1] * c[2] - c[0] * s[1] * s[2];
    q[2] = c[0] * s[1] * c[2] + s[0] * c[1] * s[2];
    q[3] = c[0] * c[1] * s[2] - s[0] * s[1] * c[2];
}

/* The turn in the body frame, as a vector along its axis, that takes an attitude to another one. It has no singularity at a large pitch. */
static void turn_between(const double from[3], const double to[3], double turn[3])
{
    double p[4], q[4];
    quaternion(from, p);
    quaternion(to, q);
    const double w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
    for (int i = 1; i < 4; i++) {
        const int j = i % 3 + 1, k = j % 3 + 1;
        turn[i - 1] = p[0] * q[i] - p[i] * q[0] - p[j] * q[k] + p[k] * q[j];
    }
    const double size = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    const double factor = size > 1e-12 ? 2.0 * atan2(size, fabs(w)) / size : 2.0;
    for (int i = 0; i < 3; i++) {
        turn[i] *= copysign(factor, w);
    }
}

/* Share the demands among the thrusters, and return their commands, the outputs as fractions, and what is met along the axes. `most` is the
 * largest output, a share of the full command. */
static void allocate(const sharing *share, const double demand[AXES], double most, double commands[], double outputs[], double met[AXES])
{
    const int count = (int)share->thrusters;
    const thruster *const own = (const thruster *)(const void *)(share + 1);
    const double *const tables = (const double *)(own + count), *const to_command = tables + 2 * (int)share->rows;
    double force[MOST_THRUSTERS] = {0.0}, room[MOST_THRUSTERS][2];
    for (int t = 0; t < count; t++) {
        const double *const rows = tables + 2 * (int)own[t].row;
        for (int way = 0; way < 2; way++) {
            const double end = way ? most : -most;
            room[t][way] = own[t].rows > 0.0 ? on_line(rows + 1, rows, (int)own[t].rows, end) : end;
        }
    }
    for (int level = 0; level < AXES; level++) {
        double more[MOST_THRUSTERS] = {0.0}, excess = 1.0;
        bool any = false;
        for (int a = 0; a < AXES; a++) {
            for (int t = 0; (int)share->priority[a] == level && t < count; t++) {
                more[t] += own[t].of_axis[a] * demand[a];
                any = true;
            }
        }
        for (int t = 0; any && share->scales != 0.0 && t < count; t++) {
            const double left = room[t][more[t] > 0.0] - force[t];
            if (fabs(more[t]) > fabs(left)) {
                excess = left * more[t] > 0.0 ? fmax(excess, more[t] / left) : INFINITY;
            }
        }
        for (int t = 0; any && t < count; t++) {
            force[t] += more[t] / excess;
        }
    }
    for (int a = 0; a < AXES; a++) {
        met[a] = 0.0;
    }
    for (int t = 0; t < count; t++) {
        const double *const rows = tables + 2 * (int)own[t].row;
        force[t] = fmin(fmax(force[t], room[t][0]), room[t][1]);
        outputs[t] = own[t].rows > 0.0 ? on_line(rows, rows + 1, (int)own[t].rows, force[t]) : force[t];
        if (share->steps > 0.0) {
            outputs[t] = floor(share->steps * outputs[t]) / share->steps;
        }
        for (int a = 0; a < AXES; a++) {
            met[a] += own[t].to_axis[a] * force[t];
        }
    }
    for (int n = 0; n < (int)share->commands; n++) {
        double sum = 0.0;
        for (int t = 0; t < count; t++) {
            sum += to_command[n * count + t] * outputs[t];
        }
        commands[n] = share->neutral + (sum > 0.0 ? share->ahead : share->astern) * within(sum, 1.0);
    }
}

/* Step the autopilot over h seconds: from what is measured at its start to the commands that are held. `mode` and `aim` are those of each
 * axis, `most` is the largest output. Demands and outputs are returned for those who look at them. */
static void autopilot_step(const loop_gains gains[AXES], const sharing *share, loop_state state[AXES], const sensor_values *now,
                           const double mode[AXES], const double aim[AXES], double most, double h, double commands[], double demand[AXES],
                           double outputs[])
{
    const bool by_turn = share->attitude != 0.0;
    const double *const angle = now->place + ROLL_AXIS;
    const double c = cos(angle[2]), d = sin(angle[2]);
    double off[AXES], rate[AXES], wanted_angle[3], met[AXES];
    memcpy(rate, now->rate, sizeof rate);
    for (int a = 0; a < AXES; a++) {
        const bool is_place = mode[a] == PLACE;
        off[a] = is_place ? aim[a] - now->place[a] : 0.0;
        if (a >= ROLL_AXIS) {
            wanted_angle[a - ROLL_AXIS] = is_place ? aim[a] : now->place[a];
        }
    }
    off[YAW_AXIS] = wrapped(off[YAW_AXIS]);
    if (by_turn) {
        turn_between(angle, wanted_angle, off + ROLL_AXIS);
    }
    const double north = off[0], east = off[1], ahead = c * now->ground[0] + d * now->ground[1];
    off[0] = c * north + d * east; /* over ground, ahead and to starboard */
    off[1] = c * east - d * north;
    rate[0] = mode[0] >= PLACE ? ahead : rate[0];
    rate[1] = mode[1] >= PLACE ? c * now->ground[1] - d * now->ground[0] : rate[1];
    rate[HEAVE_AXIS] = now->ground[2];
    double level[3] = {0.0};
    for (int a = 0; a < AXES; a++) {
        const loop_gains *const k = &gains[a];
        loop_state *const s = &state[a];
        const bool begins = mode[a] != s->mode;
        s->mode = mode[a];
        if (mode[a] == STICK) {
            const double asked = k->most > 0.0 ? k->most * aim[a] : aim[a];
            s->demand += (asked - s->demand) / (share->stick_time > 0.0 ? 1.0 + share->stick_time / h : 1.0);
        } else {
            double wanted = mode[a] == PLACE ? rate_for(off[a], k, a >= ROLL_AXIS) : aim[a];
            wanted += mode[a] == PLACE && !begins ? k->k_aim * (aim[a] - s->aim) / h : 0.0;
            s->aim = aim[a];
            s->begun = begins && k->handover > 0.0 ? 1.0 : s->begun / (1.0 + 2.0 * h / fmax(k->handover, h));
            wanted += s->begun * (rate[a] - wanted); /* the rate that there is fades away first, so that the integrator has nothing to do */
            double asked = loop_step(k, s, wanted, rate[a], h, begins);
            if (k->handover > 0.0) { /* what was demanded before fades away, so that nothing jumps */
                s->carry = begins ? s->demand - asked : s->carry / (1.0 + h / k->handover);
                asked += s->carry;
            }
            s->demand += passed(k->f_demand, h) * (limited(asked, k->most) - s->demand);
        }
        demand[a] = s->demand;
        if (by_turn && a < ROLL_AXIS && mode[a] != STICK) {
            level[a] = s->demand;
            demand[a] = 0.0;
        }
    }
    tilted(level, angle[0], angle[1], false); /* all 0 unless by_turn */
    for (int a = 0; a < ROLL_AXIS; a++) {
        demand[a] += level[a];
    }
    allocate(share, demand, most, commands, outputs, met);
    for (int a = 0; a < AXES; a++) {
        met[a] = demand[a] - met[a];
    }
    if (by_turn) {
        tilted(met, angle[0], angle[1], true);
    }
    for (int a = 0; a < AXES; a++) {
        if (mode[a] != STICK && gains[a].tracking > 0.0) { /* what the thrusters cannot give is taken back */
            state[a].integral -= h / fmax(gains[a].tracking, h) * met[a];
        }
    }
}
