"""Processes whose clock is wrong by a number of seconds that may change while they run; the clock of this computer is left alone.

A small library of C answers in place of the C library for the time of day, and for nothing else: sleeps and waits count on the
monotonic clock, as they do where somebody sets the clock of a computer. The times of files are those of the kernel, so they stay
right. The offset is in a file that every process maps, so that all of them see a change at once.
"""

import ctypes
import mmap
import shutil
import struct
import subprocess
from pathlib import Path

import psutil

SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

typedef int (*reader)(clockid_t, struct timespec *);
static volatile const int64_t *offset_s;
static reader of_the_system;

__attribute__((constructor)) static void map_offset(void)
{
    const char *path = getenv("WRONG_CLOCK_FILE");
    int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    of_the_system = (reader)dlsym(RTLD_NEXT, "clock_gettime");
    if (file >= 0) {
        void *shared = mmap(NULL, sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
        if (shared != MAP_FAILED) offset_s = shared;
        close(file);
    }
}

int clock_gettime(clockid_t id, struct timespec *now)
{
    int status = of_the_system ? of_the_system(id, now) : (int)syscall(SYS_clock_gettime, id, now);
    if (!status && offset_s && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) now->tv_sec += *offset_s;
    return status;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone)
{
    struct timespec here;
    int status = clock_gettime(CLOCK_REALTIME, &here);
    (void)zone;
    if (status) return status;
    now->tv_sec = here.tv_sec;
    now->tv_usec = here.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *out)
{
    struct timespec now;
    if (clock_gettime(CLOCK_REALTIME_COARSE, &now)) return (time_t)-1;
    if (out) *out = now.tv_sec;
    return now.tv_sec;
}
"""


class WrongClocks:
    """Clocks by name, right at first; their files and the library are in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(exist_ok=True)
        self.library = folder / "wrong_clock.so"
        (folder / "wrong_clock.c").write_text(SOURCE, encoding="ascii")
        command = ["cc", "-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", str(self.library)]
        subprocess.run([*command, str(folder / "wrong_clock.c"), "-ldl"], check=True, capture_output=True)

    @staticmethod
    def available() -> bool:
        """Whether a library can be compiled here, and put before the C library."""
        return shutil.which("cc") is not None and hasattr(ctypes.CDLL(None), "gnu_get_libc_version")

    def environment(self, name: str) -> dict[str, str]:
        """What a process needs in its environment to have this clock."""
        path = self.folder / name
        if not path.exists():
            path.write_bytes(struct.pack("=q", 0))
        return {"LD_PRELOAD": str(self.library), "WRONG_CLOCK_FILE": str(path)}

    def set(self, name: str, wrong_s: int) -> None:
        """Make a clock wrong by so many seconds in all processes that have it, at once."""
        with (self.folder / name).open("r+b") as file, mmap.mmap(file.fileno(), 8) as shared:
            shared[:8] = struct.pack("=q", wrong_s)

    def holds(self, pid: int, name: str) -> int:
        """How many processes of a family have this clock; every one must.

        Raises
        ------
        AssertionError
            One of them has the clock of this computer.
        """
        parent = psutil.Process(pid)
        family = [parent, *parent.children(recursive=True)]
        for one in family:
            mapped = {part.path for part in one.memory_maps()}
            assert str(self.folder / name) in mapped, f"{' '.join(one.cmdline())} has the right clock"
        return len(family)
