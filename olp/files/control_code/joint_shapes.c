typedef struct {            /* amplitude * sin(factor * q + phase) on one component; 6 is the own motion */
    int component;
    double amplitude, factor, phase;
} olp_harmonic;
typedef struct {            /* error motions that are read at a point, and whether it moves with the axis */
    double point[3];
    int follows, periodic;
    double low;
    const olp_curve *column[7];
} olp_motion;
typedef struct {            /* an axis, from workpiece to tool; `line` is where it really points, `across` how it shifts */
    int axis, turns, on_workpiece;
    double direction[3], point[3], line[3], across[3], shift[3], zero, datum, backlash;
    int motions;
    const olp_motion *motion;
    int harmonics, follows;
    double wave_point[3];
    const olp_harmonic *harmonic;
    double own, tilt[3], give[3];
} olp_joint;
typedef struct {            /* a weight on what a joint moves, with its centre at axis zero */
    int joint;
    double kg, centre[3];
} olp_mass;
typedef struct {            /* the own turn of a joint under gravity; `turn` are the angles of its sum per axis value */
    int joint;
    double sine, cosine;
    const double *turn;
} olp_sag;
typedef struct {            /* a rigid motion p -> turn p + shift */
    double turn[3][3], shift[3];
} olp_pose;
