# The image on the virtual board: make pil, cycles, wcet. Uses tools/make/image.mk's image.
#
# Variables: SCENARIO OUT APP USERPARAMS, for pil also MOTOR BOARD, as for `make run`; IMAGE (a finished ELF or HEX file instead of one built here).
.PHONY: pil cycles wcet target-elf
target-elf: image
	@echo $X/foc33.elf

pil_image = $(if $(IMAGE),--image $(call quoted,$(IMAGE)))

pil: setup-run $$(if $$(IMAGE),,find-xc16) ## [simulator] the image turns the motor: demo and Table 2, compared with the PC [SCENARIO= APP=name IMAGE=file MOTOR= BOARD= DEFINES= USERPARAMS= OUT=]
	$(target_setup)
	@+$(if $(MOTOR),$(ready),:)
	@$(alone) $(python) -m tools.bench.pil_command $(scenario) $(pil_image) $(options)

image_options = $(if $(SCENARIO),$(call quoted,$(SCENARIO))) $(if $(APP),--app $(call quoted,$(APP))) $(pil_image) $(if $(USERPARAMS),--userparams $(call quoted,$(USERPARAMS))) $(out) \
    $(if $(IMAGE)$(target_other),--no-budget)

cycles: setup-run $$(if $$(IMAGE),,find-xc16) ## [simulator] the control interrupt in cycles, load, latency, stack [SCENARIO= APP=name IMAGE=file.elf USERPARAMS= OUT=]
	$(target_setup)
	@$(alone) $(python) -m tools.bench.cycles $(image_options)

wcet: setup-run $$(if $$(IMAGE),,find-xc16) ## [simulator] every interrupt's longest path, proven against the deadline, and observed [SCENARIO= APP=name IMAGE=file.elf USERPARAMS= OUT=]
	$(target_setup)
	$(call build,-s build/iss/libmachine.so)
	@$(alone) $(python) -m tools.bench.wcet $(image_options)
