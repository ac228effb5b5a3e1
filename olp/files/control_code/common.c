/* What the tables below are made of: lengths in mm, angles in rad, masses in kg, temperatures in degC. */
#define OLP_STEPS 20        /* of the iteration, at most; each makes the error a hundredth or less */
#define OLP_CLOSE 1e-9      /* mm; an iteration that moves less has ended */
typedef struct {            /* one column of a curve by axis position */
    int knots, smooth;      /* smooth: the monotone cubic through slopes; else straight lines */
    const double *at, *value, *slope;
} olp_curve;

static double olp_within(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* The last knot that is not above q, but the last one. */
static int olp_cell(int knots, const double *knot, double q)
{
    int low = 0, high = knots - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (knot[middle] <= q) low = middle; else high = middle;
    }
    return low;
}

static double olp_curve_at(const olp_curve *curve, double q)
{
    int i;
    double h, s, rise, m0, m1;
    q = olp_within(q, curve->at[0], curve->at[curve->knots - 1]);
    i = olp_cell(curve->knots, curve->at, q);
    h = curve->at[i + 1] - curve->at[i];
    s = (q - curve->at[i]) / h;
    rise = curve->value[i + 1] - curve->value[i];
    if (!curve->smooth) return curve->value[i] + s * rise;
    m0 = h * curve->slope[i];
    m1 = h * curve->slope[i + 1];
    return curve->value[i] + s * (m0 + s * ((3.0 * rise - 2.0 * m0 - m1) + s * (m0 + m1 - 2.0 * rise)));
}

