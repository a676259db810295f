# make size: what the image takes. Uses tools/make/image.mk's image and commands.
.PHONY: size
absolute = $(if $(filter /%,$(firstword $1)),,$(CURDIR)/)$1
size: image ## [your board] flash, RAM and stack by module and function, against AN1292 and the budget [OPT=-O2 XC16=folder DEFINES= USERPARAMS=]
	$(target_setup)
	@$(python) -m tools.image.size $X/foc33.elf --out $X --objdump $(call quoted,$(xc16)objdump) \
	    --base OPT=$(OPT) $(foreach name,XC16 DFP USERPARAMS,$(if $($(name)),$(call quoted,$(name)=$(call absolute,$($(name)))))) \
	    $(if $(DEFINES),$(call quoted,DEFINES=$(DEFINES))) $(if $(target_other),--no-budget)
