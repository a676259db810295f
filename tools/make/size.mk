# make size: what the target image takes. Uses tools/make/image.mk's image and commands.
.PHONY: size
size: $$X/foc33.elf ## [your board] flash, RAM and stack by module and function, against AN1292 and the budget [OPT=-O2]
	$(target_setup)
	@$(python) -m tools.image.size $< --out $X --objdump $(call quoted,$(xc16)objdump) \
	    --compile $(call quoted,$(filter-out -Werror,$(target_compile))) \
	    --link $(call quoted,$(target_link) -o {elf} {objects} -Wl$(comma)-Map={map}$(comma)$(target_link_options)) \
	    $(if $(target_modes)$(USERPARAMS)$(filter-out -O2,$(OPT)),--no-budget)
