# The chip's peripherals and the lock-step comparison, on the virtual board with the simulator in it.
pil_suites := cpu_33f/test_peripherals cpu_33f/test_lock_step cpu_33f/test_selftest_image
all_suites += $(pil_suites)

$(addprefix $T/made/,$(pil_suites)): $B/libpil.so
