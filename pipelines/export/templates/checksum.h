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

static inline uint32_t tumbleline_crc32_number(uint32_t crc, @NUMBER@ value)
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
    crc = tumbleline_crc32_number(tumbleline_crc32_number(crc, c->@LOW@), c->@HIGH@);
    for (int n = 0; n < @ORDER@; n++)
        for (int i = 0; i < 3; i++) crc = tumbleline_crc32_number(crc, c->bias[n][i]);
    for (int n = 0; n < @ORDER@; n++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) crc = tumbleline_crc32_number(crc, c->@MATRIX@[n][i][j]);
    return crc == c->crc32;
}
