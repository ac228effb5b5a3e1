#ifdef OLP_SELF_TEST
/* Compares this file with the test vectors: cc -DOLP_SELF_TEST FILE.c -lm && ./a.out FILE-vectors.txt
   A line is axis values, tool vector, payload, its centre, play, error, and the command that olp finds. */
#include <stdio.h>

static int olp_read(FILE *file, double values[], int count)
{
    int k, read = 0;
    for (k = 0; k < count; k++) read += fscanf(file, "%lf", values + k) == 1;
    return read;
}

static void olp_larger(double value, double *most)
{
    if (!(fabs(value) <= *most)) *most = fabs(value);
}

int main(int count, char **words)
{
    FILE *file = count > 1 ? fopen(words[1], "r") : 0;
    olp_limits limits = {1e9, 1e9, 1e12, 1e12, 0.0, 0.0, 1};
    double most = 0.0, turned = 0.0, inverse = 0.0;
    long lines = 0, wrong = 0, steps = 0;
    if (!file) {
        fprintf(stderr, "give the file of test vectors\n");
        return 2;
    }
    for (;;) {
        double value[OLP_AXES], error[6], wanted[OLP_AXES], command[OLP_AXES], own[6];
        olp_state state;
        olp_follower follower;
        int k, read = olp_read(file, value, OLP_AXES);
        if (!read) break;
        read += olp_read(file, state.tool_mm, 3) + olp_read(file, &state.payload_kg, 1);
        read += olp_read(file, state.payload_centre_mm, 3) + olp_read(file, state.play, OLP_AXES);
        read += olp_read(file, error, 6) + olp_read(file, wanted, OLP_AXES);
        if (read != 3 * OLP_AXES + 13) {
            fprintf(stderr, "line %ld of the test vectors is not whole\n", lines + 1);
            return 2;
        }
        lines++;
        olp_error(value, &state, own);
        for (k = 0; k < 3; k++) olp_larger(own[k] - error[k], &most);
        for (k = 3; k < 6; k++) olp_larger(own[k] - error[k], &turned);
        memset(&follower, 0, sizeof follower);
        follower.share = 1.0;
        olp_follow(&follower, &limits, &state, value, 1e-3, command);
        for (k = 0; k < OLP_AXES; k++) olp_larger(command[k] - wanted[k], &inverse);
        if (follower.steps > steps) steps = follower.steps;
        wrong += follower.unsolved;
    }
    fclose(file);
    printf("%ld vectors, error differs by %.3g mm and %.3g rad at most, command by %.3g mm or deg, "
           "%ld steps at most, %ld unsolved\n", lines, most, turned, inverse, steps, wrong);
    return lines > 0 && most <= 1e-9 && turned <= 1e-11 && inverse <= 1e-6 && !wrong ? 0 : 1;
}
#endif
