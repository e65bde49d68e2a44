/* Bias tracked by a Kalman filter over steps of @STEP@ s: @PROCESSES@ Gauss-Markov processes, a walk, and the mean over the step.
 * In every step: tumbleline_bias_step, then take tumbleline_bias off the force of the step's samples, then, where the true force
 * or its magnitude is known, tumbleline_bias_known or tumbleline_bias_at_rest with the mean of the corrected force over the step.
 * The state is a struct without pointers: a copy of it keeps the filter, and the copy put back goes on with it. */
#define TUMBLELINE_PARTS @PARTS@
#define TUMBLELINE_STATES (3 * TUMBLELINE_PARTS)
typedef struct {
    @REAL@ keep[TUMBLELINE_PARTS][TUMBLELINE_PARTS];
    @REAL@ grown[3][TUMBLELINE_PARTS][TUMBLELINE_PARTS], first[3][TUMBLELINE_PARTS][TUMBLELINE_PARTS]; /* g^2 */
    @REAL@ white[3]; /* variance of the mean of a step, g^2 */
} tumbleline_bias_model;

typedef struct {
    @REAL@ x[TUMBLELINE_STATES], p[TUMBLELINE_STATES][TUMBLELINE_STATES];
    uint32_t rejected; /* updates beyond five standard deviations */
} tumbleline_bias_state;

@MODELS@
/* The unit was switched on. */
static inline void tumbleline_bias_begin(const tumbleline_bias_model *m, tumbleline_bias_state *s)
{
    memset(s, 0, sizeof *s);
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < TUMBLELINE_PARTS; i++)
            for (int j = 0; j < TUMBLELINE_PARTS; j++)
                s->p[a * TUMBLELINE_PARTS + i][a * TUMBLELINE_PARTS + j] = m->first[a][i][j];
}

/* A step of @STEP@ s goes by. */
static inline void tumbleline_bias_step(const tumbleline_bias_model *m, tumbleline_bias_state *s)
{
    enum { W = TUMBLELINE_PARTS };
    for (int a = 0; a < 3; a++) {
        @REAL@ x[W] = {0};
        for (int i = 0; i < W; i++)
            for (int j = 0; j < W; j++) x[i] += m->keep[i][j] * s->x[a * W + j];
        for (int i = 0; i < W; i++) s->x[a * W + i] = x[i];
        for (int b = 0; b < 3; b++) {
            @REAL@ half[W][W] = {{0}};
            for (int i = 0; i < W; i++)
                for (int j = 0; j < W; j++)
                    for (int k = 0; k < W; k++) half[i][j] += m->keep[i][k] * s->p[a * W + k][b * W + j];
            for (int i = 0; i < W; i++)
                for (int j = 0; j < W; j++) {
                    @REAL@ sum = a == b ? m->grown[a][i][j] : 0;
                    for (int k = 0; k < W; k++) sum += half[i][k] * m->keep[j][k];
                    s->p[a * W + i][b * W + j] = sum;
                }
        }
    }
}

/* Writes the bias, g. */
static inline void tumbleline_bias(const tumbleline_bias_state *s, @REAL@ bias[3])
{
    for (int a = 0; a < 3; a++) bias[a] = s->x[a * TUMBLELINE_PARTS + TUMBLELINE_PARTS - 1];
}

/* One scalar update: along[3] times the bias was measured. Returns 1 where it is used, 0 beyond five standard deviations. */
static inline int tumbleline_bias_update(tumbleline_bias_state *s, const @REAL@ along[3], @REAL@ measured, @REAL@ variance)
{
    @REAL@ across[TUMBLELINE_STATES] = {0}, off = measured, total = variance;
    for (int a = 0; a < 3; a++) {
        int mean = a * TUMBLELINE_PARTS + TUMBLELINE_PARTS - 1;
        off -= along[a] * s->x[mean];
        for (int i = 0; i < TUMBLELINE_STATES; i++) across[i] += s->p[i][mean] * along[a];
    }
    for (int a = 0; a < 3; a++) total += along[a] * across[a * TUMBLELINE_PARTS + TUMBLELINE_PARTS - 1];
    if (!(off * off <= 25 * total)) {
        s->rejected++;
        return 0;
    }
    for (int i = 0; i < TUMBLELINE_STATES; i++) s->x[i] += across[i] * off / total;
    for (int i = 0; i < TUMBLELINE_STATES; i++)
        for (int j = 0; j < TUMBLELINE_STATES; j++) s->p[i][j] -= across[i] * across[j] / total;
    return 1;
}

/* The true force was known: mean of the corrected force over the step, and the true one, g. */
static inline void tumbleline_bias_known(const tumbleline_bias_model *m, tumbleline_bias_state *s, const @REAL@ mean[3],
                                         const @REAL@ known[3])
{
    for (int a = 0; a < 3; a++) {
        @REAL@ along[3] = {0};
        along[a] = 1;
        tumbleline_bias_update(s, along, mean[a] - known[a], m->white[a]);
    }
}

/* The unit was at rest: length of the mean of the corrected force over the step, g, and the magnitude of gravity, g. */
static inline void tumbleline_bias_at_rest(const tumbleline_bias_model *m, tumbleline_bias_state *s, const @REAL@ mean[3],
                                           @REAL@ length, @REAL@ magnitude)
{
    @REAL@ along[3], variance = 0;
    for (int a = 0; a < 3; a++) {
        along[a] = mean[a] / length;
        variance += along[a] * along[a] * m->white[a];
    }
    tumbleline_bias_update(s, along, length - magnitude, variance);
}

