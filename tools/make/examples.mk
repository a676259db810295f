# examples/: a harness, a scenario, a motor and a board, compiled and run. Uses the variables of the main Makefile.
turn_motor := $B/examples/turn_motor

.PHONY: examples
examples: setup-run ## [tests] compile and run examples/
	$(call build,$(turn_motor) $B/libvboard.so)
	@$(turn_motor)
	@$(front_end) run examples/my_scenario.toml --out build/run/my_scenario --no-plots
	@$(front_end) run examples/my_app.toml --out build/run/my_app --no-plots
	@$(tuner) tune examples/my_motor.toml --brief --out build/tune/my_motor
	@$(front_end) run rated --motor examples/my_motor.toml --userparams build/tune/my_motor --out build/run/my_motor --no-plots
	@$(tuner) tune hurst_dmb0224c10002 --board examples/my_board.toml --brief --out build/tune/my_board

$(turn_motor): examples/turn_motor.c $B/libfirmware.a
	@mkdir -p $(@D)
	$(call say,cc,$<)$(compile) -MMD -MP -o $@ $^ -lm

$T/tools.test_examples.txt $T/made/tools/test_examples: $(turn_motor) # built before the test, not by it
$T/made/tools/test_bench_pages: $B/libfirmware.a

-include $(turn_motor).d
