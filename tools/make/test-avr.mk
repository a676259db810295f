# The unit tests where int has 16 bits, as on the target: avr-gcc and simavr. Uses the variables of the main Makefile.
# Tests with mocks or registers (the board's) and those of the closed loop in floating point stay on the PC.
avr_tests := $(filter-out $(patsubst test/%.c,%,$(shell grep -lE 'mock_|ideal_motor\.h|<xc\.h>|firmware/board|"board/' $(unit_c:%=test/%.c) /dev/null)),$(unit_c))

.PHONY: test-avr
test-avr: setup-test ## [tests] the unit tests of the control law with a 16-bit int, in an AVR simulator
	@test/static/need.sh avr-gcc=gcc-avr avr-gcc=avr-libc simavr=simavr simavr=libsimavr-dev simavr=libelf-dev
	@$(MAKE) -s $(addprefix $T/,$(avr_tests))
	@$(python) test/avr/run.py --unity $(unity) --runners $T --host $T --out build/avr --defines $(call quoted,$(DEFINES)) $(avr_tests)
