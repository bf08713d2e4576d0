/* Forward Euler and the classical Runge-Kutta method, compiled with the flags that suit them best (plain_c.py). */
#include "motion.h"

/* Every caller passes a constant `stages`, so the compiler unrolls the loops and keeps the state in registers. */
static inline __attribute__((always_inline)) void runge_kutta(int stages, const vehicle *from, double s[N_STATES], double h,
                                                              long steps)
{
    vehicle v = *from;
    const double ahead[4] = {0.0, 0.5 * h, 0.5 * h, h}, sixth = h / 6.0, third = h / 3.0;
    double now[N_STATES], to[N_STATES], k[4][N_STATES];
    hold_commands(&v);
    memcpy(now, s, sizeof now);
    for (; steps > 0; steps--) {
        for (int stage = 0; stage < stages; stage++) {
            for (int i = 0; i < N_STATES; i++) {
                to[i] = stage == 0 ? now[i] : now[i] + ahead[stage] * k[stage - 1][i];
            }
            rates(&v, to, k[stage]);
        }
        for (int i = 0; i < N_STATES; i++) {
            now[i] += stages == 1 ? h * k[0][i] : sixth * (k[0][i] + k[3][i]) + third * (k[1][i] + k[2][i]);
        }
    }
    memcpy(s, now, sizeof now);
}

void euler(vehicle *v, double *s, double h, long steps)
{
    runge_kutta(1, v, s, h, steps);
}

void rk4(vehicle *v, double *s, double h, long steps)
{
    runge_kutta(4, v, s, h, steps);
}
