# All that needs the target compiler: the image in every mode, its figures, target against PC, the unit tests as target code, the tests of the image.
# The longest first; those that use both cores by themselves in between and last.
image_suites := tools/test_image_build image/test_figures tools/test_userparams image/test_modes \
    $(addprefix cpu_33f/test_,scope_image selftest_image kept_image live_image late_application pulse_image lock_step encodings) $(addprefix tools/test_image_,constants size units) image/test_units

$T/made/image/test_figures: $B/libpil.so
$T/made/image/test_units: $$X/test/liblaw.a $$(target_test_simulator) $$(addprefix $$T/,$$(law_tests))

.PHONY: test-image
test-image: export PYTEST_ADDOPTS := -m "xc16 and not release"
test-image: setup-test find-xc16 ## [tests] what needs XC16: every mode, size, cycles, longest path, pil, tests of the image [ONLY="test_modes ..."]
	$(call run_suites,$(image_suites))
