/* Forward Euler and the classical Runge-Kutta method, with the flags that are best for them: see plain_c.py. */
#include "motion.h"

/* All but `steps` are constants where this is called, so that all is unrolled; the state stays in registers. */
static inline __attribute__((always_inline)) void runge_kutta(int stages, int n, const motion *at, double s[], double h,
                                                              long steps)
{
    const motion m = *at;
    const double ahead[4] = {0.0, 0.5 * h, 0.5 * h, h}, sixth = h / 6.0, third = h / 3.0;
    double now[7], to[7], k[4][7];
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

#define METHOD(name, stages, n)                                     \
    void name##_##n(motion *m, state *s, double h, long steps)      \
    {                                                               \
        if (n == 7) {                                               \
            prepare_axes(m);                                        \
        }                                                           \
        runge_kutta(stages, n, m, s->at, h, steps);                 \
    }
METHOD(euler, 1, 3)
METHOD(euler, 1, 7)
METHOD(rk4, 4, 3)
METHOD(rk4, 4, 7)
