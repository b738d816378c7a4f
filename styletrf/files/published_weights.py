"""Names of published files that optional measures read; this file imports nothing."""

ALEXNET = "alexnet-owt-7be5be79.pth"
RAFT = "raft_large_C_T_SKHT_V2-ff5fadd5.pth"  # ends in the beginning of its SHA-256
VGG16 = "vgg16-397923af.pth"
