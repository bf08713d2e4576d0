/* Forward Euler and the classical Runge-Kutta method, with the flags that are best for them: see plain_c.py. */
#include "motion.h"

/* All but `steps` are constants where this is called, so that all is unrolled; the state stays in registers. */
static inline __attribute__((always_inline)) void runge_kutta(int stages, int n, const motion *at, double s[], double h,
                                                              long steps)
{
    const motion m = *at;
    const double ahead[4] = {0.0, 0.5 * h, 0.5 * h, h}, sixth = h / 6.0, third = h / 3.0;
    double now[N_STATES], to[N_STATES], k[4][N_STATES];
    memcpy(now, s, (size_t)n * sizeof now[0]);
    for (; steps > 0; steps--) {
        for (int stage = 0; stage < stages; stage++) {
            for (int i = 0; i < n; i++) {
                to[i] = stage == 0 ? now[i] : now[i] + ahead[stage] * k[stage - 1][i];
            }
            rates(&m, n, to, k[stage]);
        }
        for (int i = 0; i < n; i++) {
            now[i] += stages == 1 ? h * k[0][i] : sixth * (k[0][i] + k[3][i]) + third * (k[1][i] + k[2][i]);
        }
    }
    memcpy(s, now, (size_t)n * sizeof now[0]);
}

#define METHOD(name, stages)                                               \
    void name##_velocities(motion *m, double *s, double h, long steps)     \
    {                                                                      \
        runge_kutta(stages, N_AXES, m, s, h, steps);                       \
    }                                                                      \
    void name##_all(motion *m, double *s, double h, long steps)            \
    {                                                                      \
        rov_hold(m->at, &m->gains, &m->held);                              \
        runge_kutta(stages, N_STATES, m, s, h, steps);                     \
    }
METHOD(euler, 1)
METHOD(rk4, 4)
