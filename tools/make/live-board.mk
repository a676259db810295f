# The virtual board in real time: make live-board. Variables: MOTOR BOARD DEFINES USERPARAMS as for `make run`, CPU=33f (the simulated chip, with
# XC16=folder or IMAGE=file).
.PHONY: live-board live-library
live-library:
	$(call build,$(addprefix $B/,libvboard.so foc33.elf))

live-board: setup-scope ## [run] the virtual board in real time, its serial line with the scope a pseudo-terminal [MOTOR= BOARD= DEFINES= USERPARAMS= CPU=33f IMAGE=file]
	@$(if $(CPU),$(if $(filter 33f host,$(CPU)),,echo foc33: no processor $(call quoted,CPU=$(CPU)): use 33f or host >&2; exit 2))
	@+$(if $(USERPARAMS),:,$(if $(MOTOR),$(tuner) tune $(call quoted,$(MOTOR)) $(board) --brief,:))
	@$(alone) $(python) -m tools.live.board $(if $(CPU),--cpu $(CPU)) $(if $(IMAGE),--image $(call quoted,$(IMAGE))) $(if $(DEFINES),--defines=$(call quoted,$(DEFINES))) $(what)

setup-scope:
	@tools/setup/prepare.sh scope
