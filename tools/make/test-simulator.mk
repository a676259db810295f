# The simulator's own tests: hand-derived vectors, random programs against independent references, interrupts, encodings. No XC16 is
# needed; where it is installed (PATH or XC16=dir), the encodings are held against its assembler and disassembler too.
iss_tests := $(filter-out %/test_peripherals %/test_lock_step,$(call py_tests,cpu_33f))
all_suites += $(iss_tests)

$(addprefix $T/made/,$(iss_tests)): build/iss/libmachine.so

build/iss/libmachine.so: test/cpu_33f/machine.c tools/cpu_33f/iss.h build/iss/libiss33f.a
	$(call say,ld,$@)$(CC) -std=c11 -O2 -g -fPIC $(warnings) -Werror -shared $(iss_includes) -o $@ $< \
	    -Wl$(comma)--whole-archive build/iss/libiss33f.a -Wl$(comma)--no-whole-archive -lm
