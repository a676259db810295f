# The virtual board around an image in the instruction-set simulator: build/host/libpil.so, as libvboard.so with the simulator in it.
.PHONY: pil-library
pil-library:
	$(call build,$B/libpil.so)

# Private: what they depend on, the flags file, is everybody's.
pil_objects := $(patsubst %.c,$B/%.o,$(wildcard tools/cpu_33f/*.c))
$(pil_objects): private INCLUDES += $(board_includes) -Itools/cpu_33f

$B/libpil.so: $(pil_objects) $(firmware_library)
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@.new $^ -lm && mv -f $@.new $@

-include $(pil_objects:.o=.d)
