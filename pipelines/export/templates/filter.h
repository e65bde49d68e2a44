/* Low-pass of the corrected force: @FILTER@.
 * y = sum of b[k] * x[n - k] - sum of a[k] * y[n - k]; -3 dB at @CUTOFF@ Hz of @RATE@ Hz, delay @DELAY@ ms.
 * The state is a struct without pointers: a copy of it keeps the filter, and the copy put back goes on with it. */
#define TUMBLELINE_TAPS @TAPS@
static const @REAL@ tumbleline_filter_b[TUMBLELINE_TAPS] = @B@;
static const @REAL@ tumbleline_filter_a[TUMBLELINE_TAPS] = @A@;
static const @REAL@ tumbleline_filter_steady[TUMBLELINE_TAPS] = @STEADY@;

typedef struct {
    @REAL@ z[TUMBLELINE_TAPS][3];
} tumbleline_filter_state;

/* Begins as a filter that has seen this force for ever. */
static inline void tumbleline_filter_begin(tumbleline_filter_state *s, const @REAL@ force[3])
{
    for (int k = 0; k < TUMBLELINE_TAPS; k++)
        for (int i = 0; i < 3; i++) s->z[k][i] = tumbleline_filter_steady[k] * force[i];
}

/* One sample; filtered may be force itself. */
static inline void tumbleline_filter_step(tumbleline_filter_state *s, const @REAL@ force[3], @REAL@ filtered[3])
{
    for (int i = 0; i < 3; i++) {
        @REAL@ x = force[i], y = tumbleline_filter_b[0] * x + s->z[0][i];
        for (int k = 0; k < TUMBLELINE_TAPS - 1; k++)
            s->z[k][i] = tumbleline_filter_b[k + 1] * x - tumbleline_filter_a[k + 1] * y + s->z[k + 1][i];
        filtered[i] = y;
    }
}

