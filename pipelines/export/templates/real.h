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

/* CRC-32 (ISO-HDLC): 0xCBF43926 for "123456789"; begin with crc = 0. */
static inline uint32_t tumbleline_crc32(uint32_t crc, const unsigned char *data, size_t length)
{
    crc = ~crc;
    while (length--) {
        crc ^= *data++;
        for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

static inline uint32_t tumbleline_crc32_number(uint32_t crc, @REAL@ value)
{
    unsigned char data[@BYTES@];
    @BITS@ bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < @BYTES@; i++) data[i] = (unsigned char)(bits >> (8 * i));
    return tumbleline_crc32(crc, data, sizeof data);
}

/* 1 where the coefficients are those that were exported, else 0. */
static inline int tumbleline_intact(const tumbleline_calibration *c)
{
    uint32_t crc = tumbleline_crc32(0, (const unsigned char *)c->unit, strlen(c->unit));
    crc = tumbleline_crc32_number(tumbleline_crc32_number(crc, c->low_C), c->high_C);
    for (int n = 0; n < @ORDER@; n++)
        for (int i = 0; i < 3; i++) crc = tumbleline_crc32_number(crc, c->bias[n][i]);
    for (int n = 0; n < @ORDER@; n++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) crc = tumbleline_crc32_number(crc, c->response[n][i][j]);
    return crc == c->crc32;
}

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
