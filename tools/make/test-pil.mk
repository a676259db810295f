# The chip's peripherals and the lock-step comparison, on the virtual board with the simulator in it.
pil_suites := $(addprefix cpu_33f/test_,peripherals lock_step selftest_image late_application)
all_suites += $(pil_suites)

$(addprefix $T/made/,$(pil_suites)): $B/libpil.so
