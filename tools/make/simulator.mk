# The simulator's core, without chip and board, as a library of its own: build/iss/libiss33f.a; and its benchmark.
iss_folder := build/iss$(if $(SAN),-san)
iss_sources := $(filter-out $(addprefix tools/cpu_33f/iss_,board.c cpu.c probe.c shadow.c),$(wildcard tools/cpu_33f/*.c))
iss_objects := $(iss_sources:tools/%.c=$(iss_folder)/%.o)
iss_includes := -Itools/chip -Itools/cpu_33f
iss_compile = $(CC) -std=c11 -O2 -g -fPIC $(sanitizer) $(warnings) -Werror $(iss_includes)

.PHONY: iss iss-bench
iss: ## [simulator] build/iss/libiss33f.a: the dsPIC33F's core without a board [SAN=1]
	$(call build,$(iss_folder)/libiss33f.a)

$(iss_folder)/flags: FORCE
	$(call remember,$(iss_compile) $(iss_objects))

$(iss_folder)/%.o: tools/%.c $(iss_folder)/flags
	@mkdir -p $(@D)
	$(call say,cc,$<)$(iss_compile) -MMD -MP -c $< -o $@

$(iss_folder)/libiss33f.a: $(iss_objects)
	@rm -f $@.new
	$(call say,ar,$@)ar rcs $@.new $^ && mv -f $@.new $@

iss-bench: setup-run ## [simulator] instruction cycles per second that the simulator executes on one core
	$(call build,build/iss/libmachine.so)
	@$(python) test/cpu_33f/bench.py

-include $(iss_objects:.o=.d)
