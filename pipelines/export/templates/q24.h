/* Accelerometer calibration in fixed point, run @RUN@. Every number is an integer in units of 2^-24.
 * specific force in g = M(x) * (u - b(x)), u = output / nominal scale (g), x = (temperature - 25 degrees Celsius) / 64,
 * b(x) = sum of bias[k] * x^k, M(x) = sum of inverse[k] * x^k: a polynomial fitted between low_mC and high_mC.
 * Beyond low_mC and high_mC the temperature is taken to be the nearest of the two, and tumbleline_correct returns 1.
 * Right shifts of negative numbers are taken to be arithmetic, as every common compiler does. */
#ifndef TUMBLELINE_CALIBRATION_H
#define TUMBLELINE_CALIBRATION_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct {
    const char *unit;
    int32_t low_mC, high_mC; /* temperatures that were measured, thousandths of a degree Celsius */
    int64_t per_count;       /* 2^48 g per count; 0 where the output is not in counts */
    int32_t bias[@ORDER@][3];
    int32_t inverse[@ORDER@][3][3];
    uint32_t crc32; /* of unit, low_mC, high_mC, bias and inverse, lowest byte first */
} tumbleline_calibration;

@UNITS@

@CHECKSUM@
/* What is beyond +-128 g becomes +-128 g. */
static inline int32_t tumbleline_limited(int64_t value)
{
    return value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : (int32_t)value;
}

/* The output in units of 2^-24 g, for a device whose output is in counts (@OUT_UNIT@), limited to +-128 g. */
static inline int32_t tumbleline_from_counts(const tumbleline_calibration *c, int32_t counts)
{
    int64_t high = counts * (c->per_count >> 24), low = counts * (c->per_count & 0xFFFFFF);
    return tumbleline_limited(high + ((low + ((int64_t)1 << 23)) >> 24));
}

static inline int64_t tumbleline_product(int64_t a, int64_t b) { return (a * b + ((int64_t)1 << 23)) >> 24; }

/* Writes the specific force in units of 2^-24 g to force[3]; output in the same units, temperature in thousandths of a degree.
 * Returns 0, or 1 where the temperature is beyond low_mC to high_mC: force is then that of the nearest temperature.
 * A force beyond +-128 g is limited. */
static inline int tumbleline_correct(const tumbleline_calibration *c, const int32_t output[3], int32_t temperature_mC,
                                     int32_t force[3])
{
    int32_t t = temperature_mC < c->low_mC ? c->low_mC : temperature_mC > c->high_mC ? c->high_mC : temperature_mC;
    int64_t x = ((int64_t)t - 25000) * 32768 / 125, d[3];
    for (int i = 0; i < 3; i++) {
        int64_t b = c->bias[@ORDER@ - 1][i];
        for (int n = @ORDER@ - 2; n >= 0; n--) b = c->bias[n][i] + tumbleline_product(b, x);
        d[i] = output[i] - b;
    }
    for (int i = 0; i < 3; i++) {
        int64_t sum = 0;
        for (int j = 0; j < 3; j++) {
            int64_t m = c->inverse[@ORDER@ - 1][i][j];
            for (int n = @ORDER@ - 2; n >= 0; n--) m = c->inverse[n][i][j] + tumbleline_product(m, x);
            sum += m * d[j];
        }
        force[i] = tumbleline_limited((sum + ((int64_t)1 << 23)) >> 24);
    }
    return t != temperature_mC;
}

#endif
