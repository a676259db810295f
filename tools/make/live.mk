# The virtual board in real time: make live, the page; make live-board, its serial line. Variables: MOTOR BOARD DEFINES USERPARAMS as for
# `make run`; LOOP SPEED LOAD OUT (make response); PORT ELF (a real board); CPU=33f (the simulated chip, with XC16=folder or IMAGE=file).
tuned = $(if $(USERPARAMS),:,$(if $(MOTOR),$(tuner) tune $(call quoted,$(MOTOR)) $(board) --brief,:))
.PHONY: live response live-pictures live-endurance live-board text live-library live-params setup-live setup-scope
live: setup-live ## [run] a page in the browser: buttons, load, faults, rotor and curves in real time [MOTOR= BOARD= APP=name DEFINES=-D... USERPARAMS= PACE=1 LISTEN= CPU=33f IMAGE=file PORT=/dev/ttyUSB0 ELF= KEPT=file]
	@+$(tuned)
	@$(alone) $(python) -m tools.live $(what) $(if $(DEFINES),--defines=$(call quoted,$(DEFINES))) $(if $(PACE),--pace $(call quoted,$(PACE))) $(if $(CPU),--cpu $(CPU)) $(if $(IMAGE),--image $(call quoted,$(IMAGE))) \
	    $(if $(APP),--app $(call quoted,$(APP))) $(if $(LISTEN),--listen $(call quoted,$(LISTEN))) $(if $(PORT),--port $(call quoted,$(PORT))) $(if $(ELF),--elf $(call quoted,$(ELF))) $(if $(KEPT),--kept $(call quoted,$(KEPT)))

response: setup-scope ## [run] open loops measured over the tuner's model, and steps [MOTOR=name or all, LOOP=current or speed, SPEED=rpm LOAD="N m" CPU=33f PORT=/dev/ttyUSB0 ELF= BOARD= DEFINES=-D... USERPARAMS= OUT=]
	@+$(if $(every),$(every_motor),$(tuned))
	@$(if $(every),,$(alone) $(python) -m tools.live.response_command $(options) $(if $(LOOP),--loop $(call quoted,$(LOOP))) $(if $(SPEED),--speed $(call quoted,$(SPEED))) \
	    $(if $(LOAD),--load $(call quoted,$(LOAD))) $(if $(CPU),--cpu $(call quoted,$(CPU))) $(if $(DEFINES),--defines=$(call quoted,$(DEFINES))) \
	    $(if $(PORT),--port $(call quoted,$(PORT))) $(if $(ELF),--elf $(call quoted,$(ELF))))

live-endurance: setup-browser ## [upkeep] ten minutes of make live in Chromium: what the server takes, whether memory grows, frames a second [MINUTES=10 TABS=2]
	@$(alone) $(python) -m tools.live.endurance $(if $(MINUTES),--minutes $(call quoted,$(MINUTES))) $(if $(TABS),--tabs $(call quoted,$(TABS)))

live-pictures: setup-browser ## [upkeep] write docs/live-*.png: the page of make live in a real browser
	@$(alone) $(python) -m tools.live.pictures

live-library:
	$(call build,$(addprefix $B/,libvboard.so foc33.elf))

# For tools/live/tuning.py: the parameters of this userparams.h, and what else of the firmware it decides.
live-params:
	$(call build,$(addprefix $B/,tuned.o rest.i))

$B/tuned.o: tools/live/tuned.c $B/flags | $B/params
	$(call say,cc,$<)$(compile) -MMD -MP -c $< -o $@

$B/rest.i: $B/unit.c $B/flags | $B/params
	$(call say,cpp,$<)$(compile) -w -MMD -MP -MF $(@:.i=.d) -MT $@ -E -P -DDRIVE_PARAM_INIT_H '-DDRIVE_PARAMS_INIT={0}' $< -o $@

-include $B/tuned.d $B/rest.d

live-board: setup-scope ## [run] the virtual board in real time, its serial line with the scope a pseudo-terminal [MOTOR= BOARD= DEFINES= APP=name USERPARAMS= CPU=33f IMAGE=file KEPT=file]
	@$(if $(CPU),$(if $(filter 33f host,$(CPU)),,echo foc33: no processor $(call quoted,CPU=$(CPU)): use 33f or host >&2; exit 2))
	@+$(tuned)
	@$(alone) $(python) -m tools.live.board $(if $(CPU),--cpu $(CPU)) $(if $(IMAGE),--image $(call quoted,$(IMAGE))) $(if $(DEFINES),--defines=$(call quoted,$(DEFINES))) \
	    $(if $(APP),--app $(call quoted,$(APP))) $(if $(KEPT),--kept $(call quoted,$(KEPT))) $(what)

text: setup-scope ## [your board] run, speed, stop, status, fault, clear by lines of text, of a board with APP=text [PORT=/dev/ttyUSB0 SAY="run 1500"]
	@$(if $(and $(PORT),$(SAY)),$(alone) $(python) -m tools.live.text $(call quoted,$(PORT)) $(SAY),echo 'foc33: make text needs PORT= and SAY=: as in make text PORT=/dev/ttyUSB0 SAY="run 1500"' >&2; exit 2)

setup-scope:
	@tools/setup/prepare.sh scope

setup-live:
	@tools/setup/prepare.sh live
