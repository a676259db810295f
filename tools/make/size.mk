# make size: what the image takes. Uses tools/make/image.mk's image and commands.
.PHONY: size
size: $$X/foc33.elf ## [your board] flash, RAM and stack by module and function, against AN1292 and the budget [OPT=-O2]
	$(target_setup)
	@$(python) -m tools.image.size $< --out $X --objdump $(call quoted,$(xc16)objdump) \
	    --base OPT=$(OPT) $(foreach name,XC16 DFP USERPARAMS,$(if $($(name)),$(call quoted,$(name)=$(abspath $($(name)))))) \
	    $(if $(DEFINES),$(call quoted,DEFINES=$(DEFINES))) $(if $(target_modes)$(USERPARAMS)$(filter-out -O2,$(OPT)),--no-budget)
