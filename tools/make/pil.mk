# The virtual board around an image in the instruction-set simulator: build/host/libpil.so, as libvboard.so with the simulator in it.
.PHONY: pil-library
pil-library:
	$(call build,$B/libpil.so)

# Private: what they depend on, the flags file, is everybody's.
pil_objects := $(patsubst %.c,$B/%.o,$(wildcard tools/cpu_33f/*.c))
$(pil_objects): private INCLUDES += $(board_includes) -Itools/cpu_33f
$(pil_objects): private CFLAGS += -O2

# The probe reads the image's RAM with the law's own functions in the image's layout: they are its own.
$B/tools/cpu_33f/iss_probe.o: tools/cpu_33f/iss_probe.c $B/law.c $B/flags | $B/params
	@mkdir -p $(@D)
	$(call say,cc,$<)$(compile) -I$B -MMD -MP -MF $(@:.o=.d) -MT $@ -c $< -o $@.new && objcopy --wildcard --keep-global-symbol='iss_*' $@.new $@ && rm -f $@.new

$B/libpil.so: $(pil_objects) $(firmware_library)
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@.new $^ -lm && mv -f $@.new $@

-include $(pil_objects:.o=.d)
