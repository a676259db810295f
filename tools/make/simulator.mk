# The instruction-set simulator as a library of its own: build/iss/libiss33f.a and, for Python, libiss33f.so; and its benchmark.
iss_folder := build/iss$(if $(SAN),-san)
iss_objects := $(patsubst tools/iss33f/%.c,$(iss_folder)/%.o,$(filter-out %_test.c,$(wildcard tools/iss33f/*.c)))
iss_compile = $(CC) -std=c11 -O2 -g -fPIC $(sanitizer) $(warnings) -Werror

.PHONY: iss iss-bench
iss: $(iss_folder)/libiss33f.a $(iss_folder)/libiss33f.so ## [simulator] build/iss/libiss33f.a, .so: the dsPIC33F simulator without a board [SAN=1]
	@:

$(iss_folder)/flags: FORCE
	$(call remember,$(iss_compile) $(iss_objects))

$(iss_folder)/%.o: tools/iss33f/%.c $(iss_folder)/flags
	$(call say,cc,$<)$(iss_compile) -MMD -MP -c $< -o $@

$(iss_folder)/libiss33f.a: $(iss_objects)
	@rm -f $@
	$(call say,ar,$@)ar rcs $@ $^

$(iss_folder)/libiss33f.so: $(iss_objects)
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@ $^ -lm

iss-bench: $(iss_folder)/bench ## [simulator] instructions per second that the simulator executes on one core
	@$< $(wildcard build/target/foc33.elf)

$(iss_folder)/bench: test/iss/bench.c $(iss_folder)/libiss33f.a
	$(call say,cc,$<)$(iss_compile) -Itools/iss33f -o $@ $^ -lm

-include $(iss_objects:.o=.d)
