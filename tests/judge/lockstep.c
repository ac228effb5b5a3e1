/* Preloaded into LinuxCNC, so that it runs in virtual time and in step: a servo cycle begins when the task has
   ended one of its own, and the task sees the time of the servo cycles. It also takes the module of
   kinematics from the folder of the test, as the control itself looks only where it is installed.
   LOCKSTEP: file of the counters. LOCKSTEP_DT: ns of a cycle. LOCKSTEP_MODULE: path of the module. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/select.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define MS 1000000L
enum { OTHER, SERVO, TASK };
static struct { volatile uint32_t servo, task; volatile int64_t task_seen_ns; } *shared;
static int role;
static int64_t cycle_ns = MS, begun_us, polled_us;

extern char *program_invocation_short_name;

static int64_t now_ns(void)
{
    struct timespec t;
    syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000 * MS + t.tv_nsec;
}

/* Until the counter is no longer `seen`, or `most_ns` have passed. */
static void await(volatile uint32_t *counter, uint32_t seen, int64_t most_ns)
{
    struct timespec slice = {0, 2 * MS};
    int64_t end = now_ns() + most_ns;
    for (int spins = 0; *counter == seen; spins++) {
        if (spins < 20) continue;
        if (now_ns() > end) return;
        syscall(SYS_futex, counter, FUTEX_WAIT, seen, &slice, 0, 0);
    }
}

static void step(volatile uint32_t *counter)
{
    __sync_fetch_and_add(counter, 1);
    syscall(SYS_futex, counter, FUTEX_WAKE, 1 << 30, 0, 0, 0);
}

__attribute__((constructor)) static void begin(void)
{
    const char *file = getenv("LOCKSTEP"), *ns = getenv("LOCKSTEP_DT");
    struct timeval t;
    int fd;
    if (!file) return;
    if (!strcmp(program_invocation_short_name, "rtapi_app")) role = SERVO;
    if (!strcmp(program_invocation_short_name, "milltask")) role = TASK;
    if (!role || (fd = open(file, O_RDWR | O_CLOEXEC)) < 0) { role = OTHER; return; }
    shared = mmap(0, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (shared == MAP_FAILED) role = OTHER;
    if (ns) cycle_ns = atoll(ns);
    syscall(SYS_gettimeofday, &t, 0);
    begun_us = t.tv_sec * 1000000L + t.tv_usec;
}

/* The sleep between servo cycles. Where no task runs, real time. */
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *rest)
{
    static uint32_t seen;
    if (role != SERVO || !(flags & TIMER_ABSTIME)) {
        long failed = syscall(SYS_clock_nanosleep, clock, flags, until, rest);
        return failed < 0 ? errno : 0;
    }
    step(&shared->servo);
    if (now_ns() - shared->task_seen_ns > 200 * MS) {
        struct timespec one = {0, cycle_ns};
        syscall(SYS_clock_nanosleep, CLOCK_MONOTONIC, 0, &one, 0);
    } else {
        await(&shared->task, seen, 100 * MS);
    }
    seen = shared->task;
    return 0;
}

int gettimeofday(struct timeval *restrict t, void *restrict zone)
{
    int64_t us;
    if (role != TASK) return syscall(SYS_gettimeofday, t, zone);
    shared->task_seen_ns = now_ns();
    us = begun_us + polled_us + (int64_t)shared->servo * cycle_ns / 1000;
    t->tv_sec = us / 1000000;
    t->tv_usec = us % 1000000;
    return 0;
}

/* The sleep of the task between its cycles. */
int select(int count, fd_set *r, fd_set *w, fd_set *e, struct timeval *t)
{
    struct timespec rest, *given = 0;
    long done;
    if (role == TASK && !r && !w && !e && t) {
        uint32_t seen = shared->servo;
        shared->task_seen_ns = now_ns();
        if (t->tv_sec == 0 && t->tv_usec <= 10) {
            polled_us += t->tv_usec > 0 ? t->tv_usec : 1;
            return 0;
        }
        step(&shared->task);
        await(&shared->servo, seen, 5 * MS);
        return 0;
    }
    if (t) {
        rest = (struct timespec){t->tv_sec, t->tv_usec * 1000};
        given = &rest;
    }
    done = syscall(SYS_pselect6, count, r, w, e, given, 0);
    return done < 0 ? -1 : (int)done;
}

void *dlopen(const char *file, int flags)
{
    static void *(*real)(const char *, int);
    const char *own = getenv("LOCKSTEP_MODULE"), *name, *wanted;
    if (!real) real = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
    if (own && file && (name = strrchr(own, '/')) && (wanted = strrchr(file, '/')) && !strcmp(name, wanted))
        file = own;
    return real(file, flags);
}
