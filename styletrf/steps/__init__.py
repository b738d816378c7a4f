"""The steps of the method as functions from folders to a folder, as the stages of a pipeline.

Enters: the folders of earlier steps by name, settings by field name, and a `StepRun`. Leaves: files
in an empty folder. Every step is `name(inputs, out, settings, run, *, options)`; begin with
`radiance_field`. The functions know neither Luigi nor the store, so that they also serve
programs of your own (`docs/library.md`).
"""
