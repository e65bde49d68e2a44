-- The database of the orchestrator, for 'psql --set=password=… --file=database.sql' as the superuser of PostgreSQL 14 or newer.
create role prefect login password :'password';
create database prefect owner prefect;
\connect prefect
create extension if not exists pg_trgm;
