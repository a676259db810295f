# The unit tests of the control law as the chip runs them: compiled by XC16, in the instruction-set simulator. Uses tools/make/image.mk.
# Tests with mocks, registers (the board's) or stdio and those of the closed loop in floating point stay on the PC, and so do the applications'; so does
# test_identify, whose floating point does not fit the flash beside the law.
law_tests := $(filter-out unit/test_identify unit/test_app_% $(patsubst test/%.c,%,$(shell grep -lE 'mock_|<stdio\.h>|ideal_motor\.h|<math\.h>|identify_rig\.h|bringup_rig\.h|<xc\.h>|firmware/board|"board/' $(unit_c:%=test/%.c) /dev/null)),$(unit_c))
target_test_law = $(patsubst %.c,$X/%.o,$(filter firmware/control/% firmware/drive/%,$(firmware_sources)) firmware/app/panel.c firmware/board/app_calls.c)
target_test_simulator := $B/target-test

$(target_test_simulator): test/sixteen_bit/sim_dspic.c test/sixteen_bit/ports.h $$(iss_folder)/libiss33f.a
	@mkdir -p $(@D)
	$(call say,cc,$@)$(iss_compile) -o $@ $(filter %.c %.a,$^) -lm

$X/test/liblaw.a: $$(target_test_law)
	@mkdir -p $(@D); rm -f $@; $(xc16)ar rcs $@ $^

.PHONY: test-target
test-target: setup-test find-xc16 ## [tests] the unit tests of the control law as target code, in the simulator [ONLY="test_pi ..."]
	@$(if $(call chosen,$(law_tests)),:,echo foc33: no unit test of the control law, ONLY=$(call quoted,$(ONLY)): use \
	    $(call quoted,$(sort $(notdir $(law_tests)))) >&2; exit 2)
	$(call build,-s $X/test/liblaw.a $(target_test_simulator) $B/law.c $(addprefix $T/,$(call chosen,$(law_tests))),building the tests)
	@$(in_turn) $(still) 'unit tests' $(python) test/sixteen_bit/run.py --unity $(unity) --runners $T --host $T --out $X/test \
	    --library $X/test/liblaw.a --simulator $(target_test_simulator) \
	    --compile $(call quoted,$(xc16)gcc $(target_part) $(target_flags) $(target_includes) -I$B $(DEFINES)) \
	    --link $(call quoted,$(target_link) -o {elf} {objects} -Wl$(comma)-Map={map}$(comma)$(target_link_options)) $(call chosen,$(law_tests))
