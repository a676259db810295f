# The image on the virtual board: make pil, cycles. Uses tools/make/image.mk's image.
#
# Variables: SCENARIO OUT USERPARAMS, for pil also MOTOR BOARD, as for `make run`; IMAGE (a finished ELF or HEX file instead of one built here).
.PHONY: pil cycles target-elf
target-elf: $$X/foc33.elf
	@echo $<

pil_image = $(if $(IMAGE),--image $(call quoted,$(IMAGE)))
pil_scenario = $(if $(filter file default undefined,$(origin SCENARIO)),,$(call quoted,$(SCENARIO)))

pil: setup-run $$(if $$(IMAGE),,find-xc16) ## [simulator] the image turns the motor: demo and Table 2, compared with the PC [SCENARIO= IMAGE=file OUT=]
	$(target_setup)
	@+$(if $(MOTOR),$(ready),:)
	@$(alone) $(python) -m tools.bench.pil_command $(pil_scenario) $(pil_image) $(if $(MOTOR),--motor $(call quoted,$(MOTOR))) $(board) \
	    $(if $(parameters),--userparams $(call quoted,$(parameters))) $(out)

cycles: setup-run $$(if $$(IMAGE),,find-xc16) ## [simulator] the control interrupt in cycles, load, latency, stack [SCENARIO= IMAGE=file.elf OUT=]
	@$(if $(MOTOR)$(BOARD),echo foc33: make cycles has no MOTOR and no BOARD: it takes those of its scenarios$(comma) use make pil MOTOR=name >&2; exit 2)
	$(target_setup)
	@$(alone) $(python) -m tools.bench.cycles $(pil_scenario) $(pil_image) $(if $(USERPARAMS),--userparams $(call quoted,$(USERPARAMS))) $(out) \
	    $(if $(IMAGE)$(target_modes)$(USERPARAMS)$(filter-out -O2,$(OPT)),--no-budget)
