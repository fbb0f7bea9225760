#!/bin/sh
# One check of run.sh: `check.sh NAME WHAT SYSTEM STANDARD COMPILER FLAG...` compiles, without writing anything, and
# prints a line as cargo's tests do. WORK is a folder with header.c and header.cpp. WHAT is
#
#     header       nothing but vrtm.h or vrtm.hpp: no warning
#     header_of_c  the same, always vrtm.h
#     rules        vrtm.hpp and hosts that use all of it
#     hosts        all hosts for SYSTEM: no warning but of their own for conversions, which the headers must not have
set -u
name=$1 what=$2 system=$3 standard=$4
shift 4
source=$(cd "$(dirname "$0")/../.." && pwd)
cd "$source" || exit 1

case $standard in c++*) ending=cpp ;; *) ending=c ;; esac
set -- "$@" -std="$standard" -Wall -Wextra -Wpedantic -Wconversion -Iinclude -Itests/host
case $what in
    header) set -- "$@" -Werror "$WORK/header.$ending" ;;
    header_of_c) set -- "$@" -Werror "$WORK/header.c" ;;
    hosts | rules)
        # Macros of C libraries use what C99 has not.
        [ "$standard" != c99 ] || set -- "$@" -Wno-c11-extensions
        if [ $ending = cpp ]; then
            compiled=$WORK/$(echo "$name" | tr -c 'a-z0-9+\n' _).pch
            "$@" -o "$compiled" -x c++-header "$WORK/standard.hpp" >"$compiled.log" 2>&1 || cat "$compiled.log"
            set -- "$@" -include-pch "$compiled"
        fi
        count=0
        hosts=$(echo tests/host/*."$ending")
        [ $what = hosts ] || hosts="tests/host/wrapper.cpp tests/host/viewport.cpp tests/host/farm.cpp"
        for host in $hosts; do
            if sh "$(dirname "$0")/for_system.sh" "$system" "$host"; then
                set -- "$@" "$host"
                count=$((count + 1))
            fi
        done
        name="$name ($count)"
        ;;
esac
said=$("$@" -fsyntax-only 2>&1)
code=$?
[ -z "${compiled:-}" ] || rm -f "$compiled"
bad=$(echo "$said" | grep -E '(warning|error):' | grep -v -E '^tests/host/.* warning: .*conversion\]$')
if [ "$code" = 0 ] && [ -z "$bad" ]; then
    echo "test $name ... ok"
else
    # In one piece, since another check prints beside this one.
    echo "test $name ... FAILED
exit code $code of $*
${bad:-$said}"
fi
