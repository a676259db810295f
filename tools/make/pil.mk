# The virtual board around an image in the instruction-set simulator: build/host/libpil.so, as libvboard.so with the simulator in it.
.PHONY: pil-library
pil-library: $B/libpil.so
	@:

pil_objects := $(patsubst %.c,$B/%.o,$(wildcard tools/pil/*.c) $(filter-out %_test.c,$(wildcard tools/iss33f/*.c)))

$(filter $B/tools/pil/%,$(pil_objects)): private INCLUDES += -Itools/board -Itools/iss33f
# The simulator knows nothing of the firmware: C11, its own folder only. Private: what they depend on, the flags file, is everybody's.
$(filter $B/tools/iss33f/%,$(pil_objects)): private CFLAGS := $(subst gnu99,c11,$(CFLAGS))

$B/libpil.so: $(pil_objects) $(board_objects) $(firmware_objects) $B/contents
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@ \
	    $(pil_objects) $(board_objects) $(filter-out %/main.o,$(firmware_objects)) -lm

-include $(pil_objects:.o=.d)
