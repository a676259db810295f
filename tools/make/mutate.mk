# Mutation testing: how much of what could be wrong in the firmware the tests notice. Uses the variables of the main Makefile.
.PHONY: mutate setup-mutate
mutate: setup-mutate ## [tests] plant small defects and count how many the tests notice [MUTATE="--full --closed-loop --files svm.h"]
	@$(in_turn) $(still) mutants $(python) test/mutate/mutate.py --compile $(call quoted,$(test_compile)) --tests $(unit_c) \
	    --scripts $(filter %/test_param_ranges,$(source_py)) \
	    --behaviour $(behaviour_c) $(MUTATE)

# What the tool takes over from the normal build: runners and mocks.
setup-mutate: setup-test
	$(call build,-s $(addprefix $T/,$(unit_c) $(if $(findstring --closed-loop,$(MUTATE)),$(behaviour_c))),building the tests)
