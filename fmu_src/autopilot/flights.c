/* Vehicles in closed loop with the autopilot, for Python. The vehicles belong to the engine, whose functions are passed. */
#include "autopilot.c"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { SENSORS = sizeof(sensor_values) / sizeof(double) };

/* The functions of engine.c. */
typedef bool (*step_function)(void *vehicle, double t, double h);
typedef void (*calculate_function)(void *vehicle);

/* Numbers by vehicle and step, with their strides in doubles. */
typedef struct {
    const double *at;
    ptrdiff_t per_vehicle, per_step;
} numbers;

/* The same for all vehicles of a flight. A vehicle's memory begins with its variables, the first of which are the commands.
 * `sensors` has the places of the sensors among the variables, -1 for none. Commands act `delays` steps later, at most `longest`. */
typedef struct {
    step_function step;
    calculate_function calculate;
    char *vehicles;
    double *states, *waiting; /* by vehicle: AXES loop_state; longest x commands */
    const int *sensors;
    const ptrdiff_t *delays;
    const sharing *share;
    numbers gains, modes, aims, inputs; /* inputs beside the commands */
    ptrdiff_t size, done, steps, longest, others; /* bytes of a vehicle; steps before these, and now */
    double h;
    double *seen, *demands, *outputs; /* vehicle x step x SENSORS, AXES, thrusters */
    unsigned char *failed;
} flight;

EXPORT void autopilot_command(const loop_gains gains[AXES], const sharing *share, loop_state state[AXES], const sensor_values *now,
                              const double mode[AXES], const double aim[AXES], double most, double h, double commands[]);
EXPORT void autopilot_fly(const flight *f, ptrdiff_t first, ptrdiff_t last, const volatile int *stop);
EXPORT void autopilot_sizes(ptrdiff_t sizes[6]);

/* Return the numbers of doubles in each struct, which Python compares with its own. */
void autopilot_sizes(ptrdiff_t sizes[6])
{
    const size_t of[] = {sizeof(loop_gains), sizeof(thruster), sizeof(sharing), sizeof(loop_state), sizeof(sensor_values), sizeof(flight)};
    for (int n = 0; n < 6; n++) {
        sizes[n] = (ptrdiff_t)(of[n] / sizeof(double));
    }
}

void autopilot_command(const loop_gains gains[AXES], const sharing *share, loop_state state[AXES], const sensor_values *now,
                       const double mode[AXES], const double aim[AXES], double most, double h, double commands[])
{
    double demand[AXES], outputs[MOST_THRUSTERS];
    autopilot_step(gains, share, state, now, mode, aim, most, h, commands, demand, outputs);
}

static const double *row(const numbers *n, ptrdiff_t vehicle, ptrdiff_t step)
{
    return n->at + vehicle * n->per_vehicle + step * n->per_step;
}

void autopilot_fly(const flight *f, ptrdiff_t first, ptrdiff_t last, const volatile int *stop)
{
    const ptrdiff_t count = (ptrdiff_t)f->share->thrusters, commands = (ptrdiff_t)f->share->commands;
    for (ptrdiff_t vehicle = first; vehicle < last; vehicle++) {
        void *const own = f->vehicles + vehicle * f->size;
        double *const at = own, *const waiting = f->waiting + vehicle * f->longest * commands;
        const ptrdiff_t delay = f->delays[vehicle];
        if (f->done == 0 && f->steps > 0) { /* the first velocity over ground has the current */
            memcpy(at + commands, row(&f->inputs, vehicle, 0), (size_t)f->others * sizeof(double));
        }
        for (ptrdiff_t k = 0; k < f->steps && !f->failed[vehicle] && *stop == 0; k++) {
            const ptrdiff_t n = vehicle * f->steps + k;
            double now[SENSORS], next[MOST_THRUSTERS];
            sensor_values values;
            f->calculate(own);
            for (int j = 0; j < SENSORS; j++) {
                now[j] = f->sensors[j] >= 0 ? at[f->sensors[j]] : 0.0;
            }
            memcpy(f->seen + n * SENSORS, now, sizeof now);
            memcpy(&values, now, sizeof now);
            autopilot_step((const loop_gains *)(const void *)row(&f->gains, vehicle, k), f->share,
                           (loop_state *)(void *)f->states + vehicle * AXES, &values, row(&f->modes, vehicle, k), row(&f->aims, vehicle, k),
                           1.0, f->h, next, f->demands + n * AXES, f->outputs + n * count);
            memcpy(at + commands, row(&f->inputs, vehicle, k), (size_t)f->others * sizeof(double));
            if (delay > 0) {
                double *const oldest = waiting + (f->done + k) % delay * commands;
                memcpy(at, oldest, (size_t)commands * sizeof(double));
                memcpy(oldest, next, (size_t)commands * sizeof(double));
            } else {
                memcpy(at, next, (size_t)commands * sizeof(double));
            }
            f->failed[vehicle] = !f->step(own, (double)(f->done + k) * f->h, f->h);
        }
    }
}
