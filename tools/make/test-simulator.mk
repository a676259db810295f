# The simulator's own tests: hand-derived vectors, random programs against independent references, interrupts, encodings. No XC16 is
# needed; where it is installed (PATH or XC16=dir), the encodings are held against its assembler and disassembler too.
iss_tests := $(filter-out %/test_peripherals %/test_lock_step %/test_kept_image %/test_late_application %/test_pulse_image,$(call py_tests,cpu_33f))
all_suites += $(iss_tests)

$(addprefix $T/made/,$(iss_tests) tools/test_wcet): build/iss/libmachine.so

build/iss/libmachine.so: build/iss/libiss33f.a
	$(call say,ld,$@)$(CC) -shared -o $@.new -Wl$(comma)--whole-archive $< -Wl$(comma)--no-whole-archive -lm && mv -f $@.new $@
