/* One closed loop written for itself alone: what a C compiler makes of it is the limit that the general loop is held to.

   The cart pendulum by Runge-Kutta, the sliding mode observer with compensation and tanh, LQR, and sums of squares of
   h, theta and the force: no settings, no parts, no runs that fail. A block of slots stays in the first cache. */

#include <stdint.h>
#include <string.h>

#define LANES 64
#define INLINE static inline __attribute__((always_inline))

/* M_c m l g; K; m1, beta_1, beta_2 and the two slopes */
typedef struct {
    double plant[4], gain[4], m1[2], beta_1[2], beta_2[2], slope[2];
} Settings;

/* one row a quantity */
typedef struct {
    double M_c[LANES], m[LANES], l[LANES], x[4][LANES], xhat[4][LANES], u[LANES], squares[3][LANES];
} Block;

typedef struct {
    double h, theta, v, omega;
} State;

INLINE int64_t bits(double x) {
    int64_t n;
    memcpy(&n, &x, 8);
    return n;
}

INLINE double from_bits(int64_t n) {
    double x;
    memcpy(&x, &n, 8);
    return x;
}

#define ROUND 6755399441055744.0

INLINE void sincos_of(double x, double *sin, double *cos) {
    double shifted = x * 0.6366197723675814 + ROUND, n = shifted - ROUND;
    int64_t q = bits(shifted);
    double r = x - n * 1.57079632673412561417;
    r = r - n * 6.07710050630396597660e-11;
    double z = r * r;
    double p = z * 1.591810123027412e-10 - 2.5051131455427946e-08;
    p = z * p + 2.755731610068303e-06;
    p = z * p - 0.0001984126983675497;
    p = z * p + 0.008333333333330946;
    p = z * p - 0.16666666666666666;
    double s = r * z * p + r;
    p = z * -1.1382614868556325e-11 + 2.0876146024689747e-09;
    p = z * p - 2.7557317270560326e-07;
    p = z * p + 2.4801587298763433e-05;
    p = z * p - 0.0013888888888887395;
    p = z * p + 0.041666666666666664;
    double c = z * z * p + (1.0 - 0.5 * z);
    int64_t a = bits(s), b = bits(c), swap = -(q & 1) & (a ^ b);
    *sin = from_bits((a ^ swap) ^ ((q & 2) << 62));
    *cos = from_bits((b ^ swap) ^ (((q + 1) & 2) << 62));
}

INLINE double tanh_of(double x) {
    double a = __builtin_fabs(x);
    a = a < 20.0 ? a : 20.0;
    double shifted = a * 2.8853900817779268 + ROUND, n = shifted - ROUND;
    double r = 2.0 * a - n * 6.93147180369123816490e-01;
    r = r - n * 1.90821492927058770002e-10;
    double p = r * 2.510038549551032e-08 + 2.7620088445409746e-07;
    p = r * p + 2.7557268459997064e-06;
    p = r * p + 2.4801521295954376e-05;
    p = r * p + 0.00019841269863053618;
    p = r * p + 0.0013888888917213717;
    p = r * p + 0.008333333333330062;
    p = r * p + 0.04166666666662413;
    p = r * p + 0.16666666666666669;
    p = r * p + 0.5;
    p = r * r * p + r;
    double power = from_bits((bits(shifted) + 1023) << 52);
    double e = power * p + (power - 1.0);
    return from_bits(bits(e / (e + 2.0)) | (bits(x) & INT64_MIN));
}

INLINE void accelerations(State x, double u, double M_c, double m, double l, double g, double *v, double *omega) {
    double sin, cos;
    sincos_of(x.theta, &sin, &cos);
    double inverse = 1.0 / (l * (M_c + m * sin * sin));
    double push = u + m * sin * (l * x.omega * x.omega - g * cos);
    *v = push * l * inverse;
    *omega = ((M_c + m) * g * sin - cos * (u + m * l * x.omega * x.omega * sin)) * inverse;
}

INLINE State along(State x, double h, State d) {
    return (State){x.h + h * d.h, x.theta + h * d.theta, x.v + h * d.v, x.omega + h * d.omega};
}

INLINE State step(State x, double dt, State a, State b, State c, State d) {
    State sum = along(along(a, 2.0, along(b, 1.0, c)), 1.0, d);
    return along(x, dt / 6.0, sum);
}

INLINE State moves(State x, double u, double M_c, double m, double l, double g) {
    State d = {x.v, x.omega, 0.0, 0.0};
    accelerations(x, u, M_c, m, l, g, &d.v, &d.omega);
    return d;
}

INLINE State estimates(State x, double h, double theta, double u, double m2_h, double m2_theta, const Settings *s) {
    State d;
    d.h = s->m1[0] * tanh_of(s->slope[0] * (h - x.h));
    d.theta = s->m1[1] * tanh_of(s->slope[0] * (theta - x.theta));
    accelerations(x, u, s->plant[0], s->plant[1], s->plant[2], s->plant[3], &d.v, &d.omega);
    d.v += m2_h * tanh_of(s->slope[1] * (d.h - x.v));
    d.omega += m2_theta * tanh_of(s->slope[1] * (d.theta - x.omega));
    return d;
}

/* one step of plant and observer, which sees the measurement on a straight line between two instants */
static void sample(Block *w, const Settings *settings, double dt) {
    const Settings s = *settings;
#pragma omp simd
    for (int i = 0; i < LANES; i++) {
        double u = w->u[i], size = __builtin_fabs(u), M_c = w->M_c[i], m = w->m[i], l = w->l[i], g = s.plant[3];
        State x = {w->x[0][i], w->x[1][i], w->x[2][i], w->x[3][i]};
        double h0 = x.h, theta0 = x.theta;
        State a = moves(x, u, M_c, m, l, g);
        State b = moves(along(x, 0.5 * dt, a), u, M_c, m, l, g);
        State c = moves(along(x, 0.5 * dt, b), u, M_c, m, l, g);
        State d = moves(along(x, dt, c), u, M_c, m, l, g);
        x = step(x, dt, a, b, c, d);
        w->x[0][i] = x.h;
        w->x[1][i] = x.theta;
        w->x[2][i] = x.v;
        w->x[3][i] = x.omega;
        w->squares[0][i] += x.h * x.h;
        w->squares[1][i] += x.theta * x.theta;
        double m2_h = s.beta_1[0] + s.beta_2[0] * size, m2_theta = s.beta_1[1] + s.beta_2[1] * size;
        double h = 0.5 * (h0 + x.h), theta = 0.5 * (theta0 + x.theta);
        State e = {w->xhat[0][i], w->xhat[1][i], w->xhat[2][i], w->xhat[3][i]};
        a = estimates(e, h0, theta0, u, m2_h, m2_theta, &s);
        b = estimates(along(e, 0.5 * dt, a), h, theta, u, m2_h, m2_theta, &s);
        c = estimates(along(e, 0.5 * dt, b), h, theta, u, m2_h, m2_theta, &s);
        d = estimates(along(e, dt, c), x.h, x.theta, u, m2_h, m2_theta, &s);
        e = step(e, dt, a, b, c, d);
        w->xhat[0][i] = e.h;
        w->xhat[1][i] = e.theta;
        w->xhat[2][i] = e.v;
        w->xhat[3][i] = e.omega;
    }
}

static void act(Block *w, const Settings *s) {
    for (int i = 0; i < LANES; i++) {
        double u = -(s->gain[0] * w->xhat[0][i] + s->gain[1] * w->xhat[1][i] + s->gain[2] * w->xhat[2][i] +
                     s->gain[3] * w->xhat[3][i]);
        w->u[i] = u;
        w->squares[2][i] += u * u;
    }
}

/* Blocks of slots over so many control periods of so many steps. */
void drive(Block *blocks, int n, const Settings *settings, int periods, int substeps, double dt) {
    for (int block = 0; block < n; block++) {
        for (int k = 0; k < periods; k++) {
            act(&blocks[block], settings);
            for (int j = 0; j < substeps; j++)
                sample(&blocks[block], settings, dt);
        }
    }
}
