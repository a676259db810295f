# Coverage of the control law by the unit tests. Uses the variables of the main Makefile.
# The law's functions are always inlined, once for each call; for counting they are ordinary functions, whose copies in the
# translation units gcovr adds up, and one that nobody calls is kept, so that it counts as not covered.
coverage_flags = -std=gnu99 -O0 -fkeep-inline-functions -Dalways_inline=unused
# The tests that name something of the law: the others cover none of it that these do not.
coverage_tests := $(patsubst test/%.c,%,$(shell grep -lE '"control/|golden' $(unit_c:%=test/%.c)))

.PHONY: coverage
coverage: setup-test ## [tests] the control law by the unit tests: 100 % of lines and branches required [build/coverage/index.html]
	@test/static/need.sh gcovr=gcovr
	+@$(shared) $(call lock_file,build/lock-coverage) rm -rf build/coverage build/host-coverage build/test-coverage; mkdir -p build/coverage; \
	$(still) 'building the tests' $(MAKE) -s VARIANT=coverage SAN= warnings=-w CC=$(call quoted,$(CC) --coverage) CFLAGS=$(call quoted,$(coverage_flags)) \
	    $(coverage_tests:%=build/test-coverage/%) || exit; \
	$(still) 'unit tests' sh -c 'for test; do build/test-coverage/$$test >build/coverage/output.txt 2>&1 || { \
	    cat build/coverage/output.txt; echo "$$test fails: coverage of failing tests means nothing"; exit 1; }; done' sh $(coverage_tests) || exit; \
	$(still) gcovr gcovr --root . --object-directory . --filter include/control/ --filter firmware/control/ --fail-under-line 100 --fail-under-branch 100 \
	    --html-details build/coverage/index.html --html-title "foc33 control law" --json-summary build/coverage/summary.json \
	    --txt build/coverage/report.txt --print-summary build/host-coverage build/test-coverage
