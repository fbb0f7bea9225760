#!/bin/sh
# Whether a host is for a system: `for_system.sh linux|macos|windows FILE`. One that takes threads, memory or files from
# POSIX or Linux itself, and not through platform.h or loaded.h, is not for all. sanitizers.c is none: it makes
# mistakes.
case ${2##*/} in sanitizers.c) exit 1 ;; esac
! grep -qE '^#include "(platform|loaded)\.h"' "$2" || exit 0
case $1 in
    windows) ! grep -qE '<(dlfcn|pthread|unistd|sys/[a-z]+)\.h>|posix_memalign|sysconf' "$2" ;;
    macos) ! grep -q '<malloc\.h>' "$2" ;;
esac
