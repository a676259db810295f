# Proofs of the control law and the drive.
.PHONY: proof
proof: ## [tests] Frama-C, 16-bit int: no run-time error and no overflow for any input [ONLY="tick ..." NEW=1]
	@test/static/need.sh frama-c=frama-c-base
	@$(in_turn) $(still) proof python3 test/proof/proof.py $(if $(NEW),--new) $(ONLY)
