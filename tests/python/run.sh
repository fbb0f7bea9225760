#!/bin/sh
# Installs the Python package with pip, as a user would, and runs its tests and those of the Blender add-on; ends with how
# many passed, as cargo's tests do. The exit code is 0 if none failed.
#
#     tests/python/run.sh [python|blender|blender-VERSION|short] [PYTEST OPTION...]
#
# python, blender: the package's tests, or the add-on's in each version of Blender, one after the other; without a word
# both, beside each other. blender-4.2, -4.5, -5.2: the add-on's in this version alone. short: the style of all code, and
# tests that the package solves, bakes, tells errors, and does what its documents show, in an environment that is quick to
# make.
#
# Variables: VRTM_VENV, the folder of the virtual environment (target/venv), which setup.sh makes, with Blender 4.5; those of
# other versions lie beside it. VRTM_LIBRARY, a shared library that is built already (else cargo builds one with the tests'
# profile). VRTM_REQUIRE_PYTHON=1: tests that would be skipped without an environment fail.
set -u
here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$repository/target}
venv=${VRTM_VENV:-$target/venv}
word=
# The first one's environment has the rest, too.
blenders="blender-4.5 blender-4.2 blender-5.2"
case ${1:-} in python | blender | blender-4.[25] | blender-5.2 | short) word=$1 && shift ;; esac
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
# Suites that run in turn, beside each other.
first='' second=$word
case $word in
    '') first=python second=$blenders ;;
    blender) second=$blenders ;;
    short)
        set -- tests/test_arrays.py tests/test_errors.py tests/test_header.py tests/test_readme.py tests/test_results.py "$@"
        ;;
esac
report() { echo "$target/python/$1.$2"; } # SUITE KIND: the file with its log, its exit code, or why it does not run
run() ( # SUITE PYTEST OPTION...
    suite=$1 folder=bindings/blender python=$venv/bin/python limit= && shift
    case $suite in
        python | short) folder=bindings/python ;;
        blender-4.2 | blender-5.2) python=$venv-$suite/bin/python ;;
    esac
    cd "$repository/$folder" || exit
    ! command -v timeout >/dev/null || limit="timeout $seconds"
    $limit "$python" -m pytest -q -p no:cacheprovider --color=no --durations=10 --durations-min=1 "$@" \
        >"$(report "$suite" log)" 2>&1
    echo $? >"$(report "$suite" code)"
)
in_turn() ( # SUITES PYTEST OPTION...
    suites=$1 && shift
    for suite in $suites; do
        rm -f "$(report "$suite" log)" "$(report "$suite" code)" "$(report "$suite" why)"
        case $suite in blender-4.2 | blender-5.2)
            sh "$here/setup.sh" "$venv-$suite" "$suite.txt" >"$(report "$suite" why)" &
            ;;
        esac
    done
    for suite in $suites; do
        # The other environments are loaded beside the tests in the first.
        case $suite in blender-4.2 | blender-5.2) wait ;; esac
        [ -s "$(report "$suite" why)" ] || run "$suite" "$@"
    done
)
for chain in "$first" "$second"; do in_turn "$chain" "$@" & done
wait
counted() { # WORDS LOG: a number of pytest's last line, such as that of "3 failed"
    count=$(tail -n 1 "$2" | grep -oE "[0-9]+ ($1)" | cut -d ' ' -f 1)
    echo "${count:-0}"
}
for suite in $first $second; do
    if [ -s "$(report "$suite" why)" ]; then
        why=$(cat "$(report "$suite" why)")
        if [ "${VRTM_REQUIRE_PYTHON:-0}" = 1 ]; then
            echo "FAILED $suite: $why"
            failed=$((failed + 1))
        else
            echo "skipped: the tests of $suite: $why"
            skipped=$((skipped + 1))
        fi
        continue
    fi
    log=$(report "$suite" log)
    echo "== $suite" && cat "$log"
    bad=$(($(counted failed "$log") + $(counted 'errors?' "$log")))
    # A run that ended without a count counts as one failure.
    [ "$bad" != 0 ] || [ "$(cat "$(report "$suite" code)" 2>/dev/null)" = 0 ] || bad=1
    passed=$((passed + $(counted passed "$log")))
    failed=$((failed + bad))
    skipped=$((skipped + $(counted skipped "$log")))
done
end $passed $failed $skipped
