# The chip's peripherals and the lock-step comparison, on the virtual board with the simulator in it.
pil_suites := cpu_33f/test_peripherals cpu_33f/test_lock_step
all_suites += $(pil_suites)

$(call reports,$(pil_suites)): $T/%.txt: test/$$(subst .,/,%).py $B/libpil.so
	@PIL_LIBRARY=$B/libpil.so $(alone) $(python) test/run-suite.py $@ $(python) test/run-unittest.py $<
