"""What runs outside a request, and survives the process that runs it.

Whoever orders a job writes a row (`store.jobs.submit`, in a transaction of their own) and wakes the engine. The engine
brings each unfinished row to DBOS Transact, which runs it in a thread of one process, and again after that process
died. A kind of job is one class (:class:`.runs.Kind`); what it computes, it computes in a child process
(:mod:`.computing`), and what it stores, it commits part by part through the service's one writing thread, each part
with the mark that it is done. Nothing here is imported by a request; DBOS itself not before the first job.
"""
