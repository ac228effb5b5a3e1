typedef struct {            /* amplitude * sin(factor * q + phase) of component d, and rows that it moves besides */
    int component;
    double amplitude, factor, phase;
    int rows;
    const int *row;
    const double *constant, *by_position;
} olp_wave;
typedef struct {            /* lever arm of one row: moves * position + tool - offset */
    double moves[3], offset[3];
} olp_arm;
typedef struct {            /* what one axis carries, in the order from tool to workpiece */
    int axis, carries_workpiece, terms;
    double shear[3], datum, backlash;
    int knots;
    const double *knot;
    const int *pieces;
    const olp_curve *mean[6], *half[6];
    int waves;
    const olp_wave *wave;
    olp_arm arm[3];
} olp_body;
typedef struct {            /* one argument of a grid */
    int knots, window, powers;
    const double *knot, *weight;
    const int *first;
} olp_line;
typedef struct {            /* columns over up to three axis positions */
    int arguments, columns;
    int axis[3];
    const olp_line *line[3];
    const double *value;
} olp_grid;
typedef struct {            /* components of one axis over a grid, by payload or by temperature */
    const olp_grid *grid;
    int column[6];
    olp_arm arm[3];
    int sensor;             /* -1: times payload - zero; else times the temperature of this sensor - zero */
    double zero, low, high;
} olp_table;
typedef struct {            /* expansion of a scale or of the workpiece along one axis */
    int axis, sensor, of_tip;
    double per_K, zero_degC, fixed;
} olp_expansion;

