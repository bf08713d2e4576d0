/* Forward Euler and the classical Runge-Kutta method, with the flags that are best for them: see plain_c.py. */
#include "motion.h"

/* n is a constant where these are called, so that all is unrolled; the state stays in registers. */
static inline __attribute__((always_inline)) void euler(const motion *at, int n, double s[], double h, long steps)
{
    const motion m = *at;
    double now[7], k[7];
    memcpy(now, s, (size_t)n * sizeof now[0]);
    for (; steps > 0; steps--) {
        rates(&m, n, now, k);
        for (int i = 0; i < n; i++) {
            now[i] += h * k[i];
        }
    }
    memcpy(s, now, (size_t)n * sizeof now[0]);
}

static inline __attribute__((always_inline)) void rk4(const motion *at, int n, double s[], double h, long steps)
{
    const motion m = *at;
    const double half = 0.5 * h, sixth = h / 6.0, third = h / 3.0;
    double now[7], a[7], b[7], c[7], d[7], to[7];
    memcpy(now, s, (size_t)n * sizeof now[0]);
    for (; steps > 0; steps--) {
        rates(&m, n, now, a);
        for (int i = 0; i < n; i++) {
            to[i] = now[i] + half * a[i];
        }
        rates(&m, n, to, b);
        for (int i = 0; i < n; i++) {
            to[i] = now[i] + half * b[i];
        }
        rates(&m, n, to, c);
        for (int i = 0; i < n; i++) {
            to[i] = now[i] + h * c[i];
        }
        rates(&m, n, to, d);
        for (int i = 0; i < n; i++) {
            now[i] += sixth * (a[i] + d[i]) + third * (b[i] + c[i]);
        }
    }
    memcpy(s, now, (size_t)n * sizeof now[0]);
}

void euler_velocities(motion *m, state *s, double h, long steps)
{
    euler(m, 3, s->at, h, steps);
}

void euler_states(motion *m, state *s, double h, long steps)
{
    prepare_axes(m);
    euler(m, 7, s->at, h, steps);
}

void rk4_velocities(motion *m, state *s, double h, long steps)
{
    rk4(m, 3, s->at, h, steps);
}

void rk4_states(motion *m, state *s, double h, long steps)
{
    prepare_axes(m);
    rk4(m, 7, s->at, h, steps);
}
