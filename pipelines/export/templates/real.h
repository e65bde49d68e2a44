/* Accelerometer calibration, run @RUN@.
 * specific force in g = inverse(K(t)) * (output - b(t)), t = temperature - 25 degrees Celsius,
 * b(t) = sum of bias[k] * t^k, K(t) = sum of response[k] * t^k; output in @OUT_UNIT@. */
#ifndef TUMBLELINE_CALIBRATION_H
#define TUMBLELINE_CALIBRATION_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct {
    const char *unit;
    @REAL@ low_C, high_C; /* temperatures that were measured */
    @REAL@ bias[@ORDER@][3];
    @REAL@ response[@ORDER@][3][3];
    uint32_t crc32; /* of unit, low_C, high_C, bias and response, lowest byte first */
} tumbleline_calibration;

@UNITS@

@CHECKSUM@
/* Writes the specific force in g to force[3]; returns 0, or -1 where the response cannot be inverted. */
static inline int tumbleline_correct(const tumbleline_calibration *c, const @REAL@ output[3], @REAL@ temperature_C,
                                     @REAL@ force[3])
{
    @REAL@ t = temperature_C - 25.0@F@, power = 1.0@F@, k[3][3] = {{0}}, d[3];
    for (int i = 0; i < 3; i++) d[i] = output[i];
    for (int n = 0; n < @ORDER@; n++, power *= t)
        for (int i = 0; i < 3; i++) {
            d[i] -= c->bias[n][i] * power;
            for (int j = 0; j < 3; j++) k[i][j] += c->response[n][i][j] * power;
        }
    @REAL@ m[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            m[j][i] = k[(i + 1) % 3][(j + 1) % 3] * k[(i + 2) % 3][(j + 2) % 3]
                    - k[(i + 1) % 3][(j + 2) % 3] * k[(i + 2) % 3][(j + 1) % 3];
    @REAL@ det = k[0][0] * m[0][0] + k[0][1] * m[1][0] + k[0][2] * m[2][0];
    if (det == 0.0@F@) return -1;
    for (int i = 0; i < 3; i++) force[i] = (m[i][0] * d[0] + m[i][1] * d[1] + m[i][2] * d[2]) / det;
    return 0;
}

#endif
