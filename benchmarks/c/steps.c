/* Times methods on held commands, and tells where each ends: steps LIBRARY SUNDIALS REPETITIONS < work.
 *
 * The work is sequences of commands (u_l, u_r, u_t), the first of them with a state to start from, and jobs: a method,
 * its number of states, what it may choose (sub-steps or a tolerance), the sequence, the length of a communication step
 * and of a held command, and how many commands to time. Every command's end from its own start is printed as
 * "end JOB STATE..."; then, with each method's end the start of the next command, "time JOB NANOSECONDS" a
 * communication step, all jobs in turn in each repetition. */
#include "fmu.h"

#include "motion.h"

#include "cvode.h"

/* The closed form: one step, however long. */
static __attribute__((noinline)) void closed_velocities(motion *m, state *s, double h, long steps)
{
    (void)steps;
    for (int i = 0; i < 3; i++) {
        s->at[i] = riccati_velocity(&m->axis[i], s->at[i], h);
    }
}

static __attribute__((noinline)) void closed_states(motion *m, state *s, double h, long steps)
{
    (void)steps;
    rov_state next;
    rov_step(&m->coefficients, &m->gains, &m->inputs, &s->named, h, &next);
    s->named = next;
}

typedef struct {
    long commands, starts;
    double (*command)[3];
    double (*force)[3]; /* C of each axis */
    state *start;
} sequence;

typedef struct {
    char method[16];
    int states, sequence;
    double setting, h, hold;
    long commands, steps;
    advance *advance; /* none of the FMU and of CVODE */
    cvode cvode;
} job;

static motion m;
static sequence *sequences;
static fmi2Component rov;

static void *allocate(long count, size_t size)
{
    void *const memory = calloc((size_t)count, size);
    check(memory != NULL, "out of memory");
    return memory;
}

static double real(void)
{
    double value;
    check(scanf("%lf", &value) == 1, "a number is missing in the work");
    return value;
}

static void read_sequence(sequence *q)
{
    check(scanf("%ld %ld", &q->commands, &q->starts) == 2, "a sequence is missing");
    q->command = allocate(q->commands, sizeof *q->command);
    q->force = allocate(q->commands, sizeof *q->force);
    q->start = allocate(q->starts, sizeof *q->start);
    for (long n = 0; n < q->commands; n++) {
        for (int i = 0; i < 3; i++) {
            q->command[n][i] = real();
        }
        m.inputs = (rov_inputs){.u_l = q->command[n][0], .u_r = q->command[n][1], .u_t = q->command[n][2]};
        prepare_axes(&m);
        for (int i = 0; i < 3; i++) {
            q->force[n][i] = m.axis[i].C;
        }
    }
    for (long n = 0; n < q->starts; n++) {
        for (int i = 0; i < 7; i++) {
            q->start[n].at[i] = real();
        }
    }
}

static void read_job(job *j)
{
    static const struct {
        const char *name;
        advance *of_three, *of_seven;
    } methods[] = {{"euler", euler_velocities, euler_states},
                   {"rk4", rk4_velocities, rk4_states},
                   {"closed", closed_velocities, closed_states}};
    check(scanf("%15s %d %lf %d %lf %lf %ld", j->method, &j->states, &j->setting, &j->sequence, &j->h, &j->hold,
                &j->commands) == 7, "a job is missing");
    j->steps = (long)(j->hold / j->h + 0.5);
    for (size_t i = 0; i < sizeof methods / sizeof methods[0]; i++) {
        if (strcmp(j->method, methods[i].name) == 0) {
            j->advance = j->states == 3 ? methods[i].of_three : methods[i].of_seven;
        }
    }
    if (j->advance == NULL && strcmp(j->method, "fmu") != 0) {
        const bool bdf = strcmp(j->method, "bdf") == 0;
        cvode_create(&j->cvode, &m, j->states, bdf ? BDF : ADAMS, strcmp(j->method, "adams-fixed") == 0, j->setting);
    }
}

/* The command n of the job from the state s on. */
static void hold(job *j, long n, state *s)
{
    const sequence *const q = &sequences[j->sequence];
    const double *const command = q->command[n];
    if (j->advance != NULL) {
        const double h = j->h / j->setting;
        const long steps = (long)j->setting;
        if (j->states == 3) {
            for (int i = 0; i < 3; i++) {
                m.axis[i].C = q->force[n][i];
            }
        } else {
            m.inputs = (rov_inputs){.u_l = command[0], .u_r = command[1], .u_t = command[2]};
        }
        for (long i = 0; i < j->steps; i++) {
            j->advance(&m, s, h, steps);
        }
    } else if (j->cvode.solver != NULL) {
        m.inputs = (rov_inputs){.u_l = command[0], .u_r = command[1], .u_t = command[2]};
        prepare_axes(&m);
        cvode_begin(&j->cvode, s, j->hold);
        for (long i = 0; i < j->steps; i++) {
            cvode_advance(&j->cvode, s, j->h);
        }
    } else {
        double t = 0.0;
        check(fmi2.SetReal(rov, COMMANDS, 3, command) == fmi2OK, "fmi2SetReal failed");
        for (long i = 0; i < j->steps; i++, t += j->h) {
            check(fmi2.DoStep(rov, t, j->h, fmi2True) == fmi2OK, "fmi2DoStep failed");
        }
    }
}

static void print_ends(job *j, int number)
{
    const sequence *const q = &sequences[j->sequence];
    for (long n = 0; n < q->starts; n++) {
        state s = q->start[n];
        start_instance(rov, STATES, 7, s.at);
        hold(j, n, &s);
        if (strcmp(j->method, "fmu") == 0) {
            check(fmi2.GetReal(rov, STATES, 7, s.at) == fmi2OK, "fmi2GetReal failed");
        }
        printf("end %d", number);
        for (int i = 0; i < j->states; i++) {
            printf(" %a", s.at[i]);
        }
        printf("\n");
    }
}

static void print_time(job *j, int number)
{
    state s = sequences[j->sequence].start[0];
    start_instance(rov, STATES, 7, s.at);
    const double start = nanoseconds();
    for (long n = 0; n < j->commands; n++) {
        hold(j, n, &s);
    }
    printf("time %d %.17g\n", number, (nanoseconds() - start) / (double)(j->commands * j->steps));
}

int main(int argc, char *argv[])
{
    check(argc == 4, "usage: steps LIBRARY SUNDIALS REPETITIONS < work");
    load_fmu(argv[1]);
    load_sundials(argv[2]);
    union {
        double at[N_VARIABLES];
        rov_variables named;
    } defaults;
    for (int i = 0; i < N_VARIABLES; i++) {
        defaults.at[i] = VARIABLES[i].start;
    }
    m.coefficients = defaults.named.coefficients;
    rov_prepare(&m.coefficients, &m.gains);
    rov = new_instance();
    int n_sequences, n_jobs;
    check(scanf("%d %d", &n_sequences, &n_jobs) == 2, "the work is missing");
    sequences = allocate(n_sequences, sizeof *sequences);
    for (int i = 0; i < n_sequences; i++) {
        read_sequence(&sequences[i]);
    }
    job *const jobs = allocate(n_jobs, sizeof *jobs);
    for (int i = 0; i < n_jobs; i++) {
        read_job(&jobs[i]);
        print_ends(&jobs[i], i);
    }
    for (int n = atoi(argv[3]); n > 0; n--) {
        for (int i = 0; i < n_jobs; i++) { /* every other time backwards */
            const int number = n % 2 == 0 ? i : n_jobs - 1 - i;
            print_time(&jobs[number], number);
        }
    }
    return 0;
}
