#!/bin/sh
# Runs the unit tests on a firmware built with clang's undefined, integer and implicit-conversion sanitizers: any wrap-around, shift,
# or narrowing in firmware/ and include/ that is not marked as intended is a failure.
set -u

sanitize=-fsanitize=undefined,integer,implicit-conversion
logs=build/static/ubsan
rm -rf "$logs"
mkdir -p "$logs"

test/static/need.sh clang-14=clang-14 || exit 2
if ! echo 'int main(void) { return 0; }' | clang-14 $sanitize -x c - -o "$logs/try" 2>/dev/null; then
    test/static/need.sh ubsan-runtime=libclang-rt-14-dev || exit 2
fi

report=$(UBSAN_OPTIONS=log_path=$logs/run make CC=clang-14 VARIANT=ubsan SAN= ONLY="$(cd test && ls unit/test_*.c | sed 's|\.c$||' | tr '\n' ' ')" sanitizer="$sanitize" \
    CFLAGS="-std=gnu99 -O0 -fPIC -fsanitize-ignorelist=test/static/ubsan-ignore.txt $sanitize" test-quick 2>&1)
echo "$report" | sed '$d'
summary=$(echo "$report" | grep -E '^[0-9]+ passed, [0-9]+ failed$' | tail -n 1)
passed=${summary%% passed*}
failed=${summary##*passed, }
failed=${failed%% failed}
if [ -z "$summary" ] || [ "$passed" -eq 0 ]; then
    echo "foc33: make ubsan, unit tests: did not run; see the messages above" >&2
    exit 1
fi

# One line a place; the numbers in the message differ from run to run.
places=$(cat "$logs"/run* 2>/dev/null | sed -n "s|^\($PWD/\)\{0,1\}\([^:]*:[0-9]*\):[0-9]*: runtime error: \(.*\)|\2 \3|p" | sort -u -k1,1)
if [ -n "$places" ]; then
    echo "$places" | sed 's/^/  /'
    count=$(echo "$places" | wc -l)
    echo "no_unmarked_wrap_around: FAIL: $count places"
    failed=$((failed + 1))
else
    echo "no_unmarked_wrap_around: PASS"
    passed=$((passed + 1))
fi
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
