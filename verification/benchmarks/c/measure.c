/* Measure held commands by several methods. plain_c.py calls this library, which is linked with SUNDIALS. Times are
 * processor time of this thread. */
#define _POSIX_C_SOURCE 200809L
#include "fmu.h"
#include "motion.h"

#include <time.h>

/* All value references; the commands come first. */
static unsigned reference[N_VARIABLES];
static const unsigned *const COMMANDS = reference, *const STATES = reference + FIRST_STATE;
static vehicle v;
static fmu_instance rov;
static const fmu_host CALLBACKS;

static double nanoseconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* Reset an instance, set n values and initialize it. */
static void start_instance(fmu_instance c, const unsigned vr[], size_t n, const double values[])
{
    CHECK(API.Reset(c) == 0 && set_values(c, vr, n, values));
    initialize(c);
}

/* Load the FMU. This is the first call. */
void begin(const char *path)
{
    for (int i = 0; i < N_VARIABLES; i++) {
        v.at[i] = VARIABLES[i].start;
        reference[i] = FIRST_REFERENCE + (unsigned)i;
    }
    model_prepare(v.at, &v.numbers);
    load_fmu(path);
    rov = new_instance("rov", &CALLBACKS);
}

/* ---- Methods ---- */

/* Our method takes one step of any length. */
void core(vehicle *at, double state[N_STATES], double h, long steps)
{
    (void)steps;
    double next[N_STATES], heading = 0.0;
    memcpy(&at->at[FIRST_STATE], state, sizeof next);
    CHECK(motion_step(at->at, &at->numbers, h, next, &heading) > 0);
    memcpy(state, next, sizeof next);
}

/* SUNDIALS CVODE: FMPy ships its libraries without headers. plain_c.py makes the solvers. */
typedef void *handle;
enum { NORMAL = 1 }; /* task */
double *N_VGetArrayPointer(handle vector);
int CVodeReInit(handle solver, double t, handle y);
int CVodeSetStopTime(handle solver, double t);
int CVode(handle solver, double t, handle y, double *reached, int task);

int cvode_rates(double t, handle y, handle rate, void *user)
{
    (void)t, (void)user;
    rates(&v, N_VGetArrayPointer(y), N_VGetArrayPointer(rate));
    return 0;
}

/* The solver starts again with each held command, because the right side jumps there, and ends at a stop time. */
static __attribute__((noinline)) void solve(handle solver, handle y, double s[N_STATES], double h, long steps)
{
    const size_t size = N_STATES * sizeof s[0];
    double *const now = N_VGetArrayPointer(y), reached, t = 0.0;
    hold_commands(&v);
    memcpy(now, s, size);
    CHECK((CVodeReInit(solver, 0.0, y) | CVodeSetStopTime(solver, h * (double)steps)) == 0);
    for (long i = 0; i < steps; i++) {
        t += h;
        CHECK(CVode(solver, t, y, &reached, NORMAL) >= 0);
        memcpy(s, now, size);
    }
}

/* Hold n commands in turn from the state s on, each for `steps` communication steps of h, by a method in so many
 * sub-steps, by a solver, or, with neither, in the FMU; there, without sub-steps, the commands are set before every step.
 * Returns the nanoseconds of a communication step; s becomes the end. */
double hold(advance *method, handle solver, handle y, double h, long substeps, long steps, long n,
            const double command[][N_COMMANDS], double s[N_STATES])
{
    const bool in_fmu = method == NULL && solver == NULL;
    if (in_fmu) {
        start_instance(rov, STATES, N_STATES, s);
    }
    const double start = nanoseconds();
    for (long i = 0; i < n; i++) {
        memcpy(v.at, command[i], sizeof command[i]);
        if (method != NULL) {
            for (long step = 0; step < steps; step++) {
                method(&v, s, h / (double)substeps, substeps);
            }
        } else if (solver != NULL) {
            solve(solver, y, s, h, steps);
        } else {
            double t = 0.0;
            for (long step = 0; step < steps; step++, t += h) {
                CHECK((step > 0 && substeps > 0) || set_values(rov, COMMANDS, N_COMMANDS, command[i]));
                CHECK(do_step(rov, t, h));
            }
        }
    }
    const double each = (nanoseconds() - start) / (double)(n * steps);
    if (in_fmu) {
        CHECK(get_values(rov, STATES, N_STATES, s));
    }
    return each;
}
