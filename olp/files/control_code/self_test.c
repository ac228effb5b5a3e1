
#ifdef OLP_SELF_TEST
/* Compares this file with the test vectors: cc -DOLP_SELF_TEST FILE.c -lm && ./a.out FILE-vectors.txt
   A line is axis position, tool vector, payload, play, temperatures, and the error that olp finds there. */
#include <stdio.h>

int main(int count, char **words)
{
    FILE *file = count > 1 ? fopen(words[1], "r") : 0;
    olp_limits limits = {1e9, 1e9, 1e12, 1e12, 0.0, 0.0, 1};
    double most = 0.0, inverse = 0.0;
    long lines = 0, wrong = 0, steps = 0;
    if (!file) {
        fprintf(stderr, "give the file of test vectors\n");
        return 2;
    }
    for (;;) {
        double axis[3], error[3], wanted[3], command[3], own[3], next[3];
        olp_state state;
        olp_follower follower;
        int k, read = 0;
        for (k = 0; k < 3; k++) read += fscanf(file, "%lf", axis + k) == 1;
        if (!read) break;
        for (k = 0; k < 3; k++) read += fscanf(file, "%lf", state.tool_mm + k) == 1;
        read += fscanf(file, "%lf", &state.payload_kg) == 1;
        for (k = 0; k < 3; k++) read += fscanf(file, "%lf", state.play + k) == 1;
        for (k = 0; k < OLP_SENSORS; k++) read += fscanf(file, "%lf", state.temperature_degC + k) == 1;
        for (k = 0; k < 3; k++) read += fscanf(file, "%lf", error + k) == 1;
        if (read != 13 + OLP_SENSORS) {
            fprintf(stderr, "line %ld of the test vectors is not whole\n", lines + 1);
            return 2;
        }
        lines++;
        olp_error(axis, &state, own);
        for (k = 0; k < 3; k++)
            if (!(fabs(own[k] - error[k]) <= most)) most = fabs(own[k] - error[k]);
        /* from there, a short move: back through the model it has to end where it was wanted */
        memset(&follower, 0, sizeof follower);
        follower.share = 1.0;
        olp_led(&follower, &state, axis);
        for (k = 0; k < 3; k++) follower.play[k] = state.play[k] < 0.0 ? -1.0 : 1.0;
        olp_forward(&follower, &state, axis, wanted);
        for (k = 0; k < 3; k++) wanted[k] += lines % (k + 2) ? 0.01 : -0.01;
        olp_follow(&follower, &limits, &state, wanted, 1e-3, command);
        olp_forward(&follower, &state, command, next);
        for (k = 0; k < 3; k++)
            if (!(fabs(next[k] - wanted[k]) <= inverse)) inverse = fabs(next[k] - wanted[k]);
        if (follower.steps > steps) steps = follower.steps;
        wrong += follower.unsolved;
    }
    fclose(file);
    printf("%ld vectors, error differs by %.3g mm at most, inverse by %.3g mm, %ld steps at most, %ld unsolved\n",
           lines, most, inverse, steps, wrong);
    return lines > 0 && most <= 1e-9 && inverse <= 1e-6 && !wrong ? 0 : 1;
}
#endif
