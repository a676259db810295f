# The chip's peripherals and the lock-step comparison, on the virtual board with the simulator in it.
pil_suites := $(addprefix cpu_33f/test_,peripherals lock_step selftest_image)
all_suites += $(pil_suites)

# The late application and the measured pulses have no test without the compiler: make test-image.
$(addprefix $T/made/,$(pil_suites) $(addprefix cpu_33f/test_,kept_image late_application live_image pulse_image)): $B/libpil.so
