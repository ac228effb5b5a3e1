/* A stand-in for HAL: enough of it that a kinematics module of LinuxCNC can be called outside of LinuxCNC.
   Pins are kept by name, so that a test can set them. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST 512
static struct { char name[96]; double *data; } pins[MOST];
static int count;

static int keep(const char *name, void **data)
{
    if (count == MOST) return -1;
    snprintf(pins[count].name, sizeof pins[count].name, "%s", name);
    pins[count].data = calloc(1, 16);
    *data = pins[count++].data;
    return 0;
}

double *stand_in_pin(const char *name)
{
    for (int i = count - 1; i >= 0; i--)
        if (!strcmp(pins[i].name, name)) return pins[i].data;
    return NULL;
}

#define NEWF(type) \
    int hal_pin_##type##_newf(int dir, void **data, int comp, const char *form, ...) \
    { \
        char name[96]; \
        va_list words; \
        va_start(words, form); \
        vsnprintf(name, sizeof name, form, words); \
        va_end(words); \
        return keep(name, data); \
    }
#define NEW(type) \
    int hal_pin_##type##_new(const char *name, int dir, void **data, int comp) { return keep(name, data); }

NEWF(float) NEWF(bit) NEWF(s32) NEWF(u32)
NEW(float) NEW(bit) NEW(s32) NEW(u32)

int hal_init(const char *name) { return 1; }
int hal_ready(int comp) { return 0; }
int hal_exit(int comp) { return 0; }
void *hal_malloc(long size) { return calloc(1, size); }
void rtapi_print(const char *form, ...) {}
void rtapi_print_msg(int level, const char *form, ...) {}
