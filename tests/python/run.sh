#!/bin/sh
# Installs the Python package with pip, as a user would, and runs its tests and those of the Blender add-on; ends with how
# many passed, as cargo's tests do. The exit code is 0 if none failed.
#
#     tests/python/run.sh [python|blender|short] [PYTEST OPTION...]
#
# python, blender: the package's tests, or the add-on's; without a word both, beside each other. short: the style of all
# code, and tests that the package solves, bakes, tells errors, and does what its documents show, in an environment that is
# quick to make.
#
# Variables: VRTM_VENV, the folder of the virtual environment (target/venv), which setup.sh makes; VRTM_LIBRARY, a shared
# library that is built already (else cargo builds one with the tests' profile); VRTM_REQUIRE_PYTHON=1: tests that would be
# skipped without an environment fail.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
venv=${VRTM_VENV:-$target/venv}
word=
case ${1:-} in python | blender | short) word=$1 && shift ;; esac
requirements=requirements.txt
if [ "$word" = short ] && ! [ -f "$venv/requirements.txt" ]; then
    venv=${VRTM_VENV:-$target/venv-short} requirements=short.txt
fi
# The longest that all tests of one folder may take, in seconds.
seconds=${VRTM_PYTHON_SECONDS:-2400}

end() { # PASSED FAILED SKIPPED
    result=ok
    [ "$2" = 0 ] || result=FAILED
    echo "test result: $result. $1 passed; $2 failed; $3 ignored"
    [ "$2" = 0 ]
    exit
}

why=$(sh "$here/setup.sh" "$venv" $requirements) || {
    if [ "${VRTM_REQUIRE_PYTHON:-0}" = 1 ]; then
        echo "FAILED python: $why"
        end 0 1 0
    fi
    echo "skipped: the tests in Python: $why"
    end 0 0 1
}
sh "$here/install.sh" "$venv" || end 0 1 0
# The tests are of what is installed, with the library that is in it.
unset VRTM_LIBRARY
export PYTHONDONTWRITEBYTECODE=1

passed=0 failed=0 skipped=0
# Style and likely mistakes; the settings stand in bindings/ruff.toml.
case $word in '' | short)
    if (cd "$repository/bindings" && "$venv/bin/ruff" check --quiet --no-cache . &&
        "$venv/bin/ruff" format --check --quiet --no-cache .); then
        passed=1
    else
        echo "FAILED ruff: see above (ruff check --fix, ruff format)"
        failed=1
    fi
    ;;
esac
case $word in
    '') folders="bindings/python bindings/blender" ;;
    short)
        folders=bindings/python
        set -- tests/test_arrays.py tests/test_errors.py tests/test_header.py tests/test_readme.py tests/test_results.py "$@"
        ;;
    *) folders=bindings/$word ;;
esac
for folder in $folders; do
    report=$target/python/${word:-$(basename $folder)}
    rm -f "$report.code"
    (
        cd "$repository/$folder" || exit 1
        limit=
        ! command -v timeout >/dev/null || limit="timeout $seconds"
        $limit "$venv/bin/python" -m pytest -q -p no:cacheprovider --color=no --durations=10 --durations-min=1 \
            "$@" >"$report.log" 2>&1
        echo $? >"$report.code"
    ) &
done
wait
counted() { # WORDS LOG: a number of pytest's last line, such as that of "3 failed"
    count=$(tail -n 1 "$2" | grep -oE "[0-9]+ ($1)" | cut -d ' ' -f 1)
    echo "${count:-0}"
}
for folder in $folders; do
    report=$target/python/${word:-$(basename $folder)}
    cat "$report.log"
    bad=$(($(counted failed "$report.log") + $(counted 'errors?' "$report.log")))
    # A run that ended without a count counts as one failure.
    [ "$bad" != 0 ] || [ "$(cat "$report.code" 2>/dev/null)" = 0 ] || bad=1
    passed=$((passed + $(counted passed "$report.log")))
    failed=$((failed + bad))
    skipped=$((skipped + $(counted skipped "$report.log")))
done
end $passed $failed $skipped
