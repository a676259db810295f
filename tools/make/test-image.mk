# All that needs the target compiler: the image in every mode, its figures, target against PC, the unit tests as target code, the tests of the image.
image_checks := $(call py_tests,image)
image_suites := $(image_checks) $(addprefix cpu_33f/test_,lock_step scope_image selftest_image encodings) \
    $(addprefix tools/test_,image_build image_constants image_size image_units userparams)

$(addprefix $T/made/,$(image_checks)): $B/libpil.so build/iss/libmachine.so
$T/made/image/test_units: $$X/test/liblaw.a $$(target_test_simulator) $$(addprefix $$T/,$$(law_tests))

.PHONY: test-image
test-image: export PYTEST_ADDOPTS := -m xc16
test-image: setup-test find-xc16 ## [tests] what needs XC16: every mode, size, cycles, longest path, pil, tests of the image [ONLY="test_modes ..."]
	$(call run_suites,$(image_suites))
