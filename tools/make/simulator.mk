# The instruction-set simulator as a library of its own: build/iss/libiss33f.a and, for Python, libiss33f.so; and its benchmark.
iss_folder := build/iss$(if $(SAN),-san)
iss_sources := $(wildcard tools/plant/*.c tools/chip/*.c) $(filter-out $(addprefix tools/cpu_33f/iss_,board.c probe.c shadow.c),$(wildcard tools/cpu_33f/*.c))
iss_objects := $(iss_sources:tools/%.c=$(iss_folder)/%.o)
iss_includes := -Itools/plant -Itools/chip -Itools/cpu_33f
iss_compile = $(CC) -std=c11 -O2 -g -fPIC $(sanitizer) $(warnings) -Werror $(iss_includes)

.PHONY: iss iss-bench
iss: $(iss_folder)/libiss33f.a $(iss_folder)/libiss33f.so ## [simulator] build/iss/libiss33f.a, .so: the dsPIC33F simulator without a board [SAN=1]
	@:

$(iss_folder)/flags: FORCE
	$(call remember,$(iss_compile) $(iss_objects))

$(iss_folder)/%.o: tools/%.c $(iss_folder)/flags
	@mkdir -p $(@D)
	$(call say,cc,$<)$(iss_compile) -MMD -MP -c $< -o $@

$(iss_folder)/libiss33f.a: $(iss_objects)
	@rm -f $@
	$(call say,ar,$@)ar rcs $@ $^

$(iss_folder)/libiss33f.so: $(iss_objects)
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@ $^ -lm

iss-bench: $(iss_folder)/bench setup-run ## [simulator] instructions per second that the simulator executes on one core
	@elf=$(or $(IMAGE),$(wildcard build/target/foc33.elf)); test -z "$$elf" || $(python) -m tools.image.load "$$elf" >$(iss_folder)/bench.image || exit; \
	    $< $${elf:+$(iss_folder)/bench.image}

$(iss_folder)/bench: test/cpu_33f/bench.c $(iss_folder)/libiss33f.a
	$(call say,cc,$<)$(iss_compile) -o $@ $^ -lm

-include $(iss_objects:.o=.d)
