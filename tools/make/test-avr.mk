# The unit tests of the control law where int has 16 bits, as on the chip: avr-gcc and simavr. Uses the variables of the main Makefile.
# Tests with mocks or registers (the board's) and those of the closed loop in floating point stay on the PC.
law_tests := $(filter-out $(patsubst test/%.c,%,$(shell grep -lE 'mock_|ideal_motor\.h|identify_rig\.h|bringup_rig\.h|<xc\.h>|firmware/board|"board/' $(unit_c:%=test/%.c) /dev/null)),$(unit_c))
sixteen_bit = @$(in_turn) $(still) 'unit tests' $(python) test/sixteen_bit/run.py --unity $(unity) --runners $T --host $T

avr_compile = avr-gcc -mmcu=atmega2560 -std=gnu99 -O2 -fno-ivopts -ffunction-sections -fdata-sections -Iinclude -I. $(DEFINES)
avr_law := $(patsubst %.c,build/avr/%.o,$(wildcard firmware/control/*.c firmware/drive/*.c firmware/drive/*/*.c))

build/avr/flags: FORCE
	$(call remember,$(avr_compile) $(avr_law))

build/avr/%.o: %.c build/avr/flags
	@mkdir -p $(@D)
	$(call say,avr,$<)$(avr_compile) -Wall -Wextra -Wconversion -MMD -MP -c $< -o $@

build/avr/liblaw.a: $(avr_law)
	@rm -f $@; avr-ar rcs $@ $^

build/avr/sim: test/sixteen_bit/sim_avr.c test/sixteen_bit/run_image.h test/sixteen_bit/ports.h build/avr/flags
	$(call say,cc,$@)$(CC) -std=gnu99 -O2 -Wall -Wextra -o $@ $< -lsimavr -lelf

.PHONY: test-avr
test-avr: setup-test ## [tests] the unit tests of the control law with a 16-bit int, in an AVR simulator
	@test/static/need.sh avr-gcc=gcc-avr avr-gcc=avr-libc simavr=simavr simavr=libsimavr-dev simavr=libelf-dev
	$(call build,-s $(addprefix $T/,$(call chosen,$(law_tests))) build/avr/liblaw.a build/avr/sim,building the tests)
	$(sixteen_bit) --out build/avr --library build/avr/liblaw.a --simulator build/avr/sim --compile $(call quoted,$(avr_compile)) \
	    --link 'avr-gcc -mmcu=atmega2560 -Wl,--gc-sections -o {elf} {objects} -lm' $(call chosen,$(law_tests))

-include $(avr_law:.o=.d)
